//! Form-finding of tensegrity structures: configurations in stable equilibrium.
//!
//! One module answers one question. None of them draws random numbers unless a seed is given, and
//! all of them are silent.
