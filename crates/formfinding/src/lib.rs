//! Stable, collision-free configurations of tensegrity structures.
