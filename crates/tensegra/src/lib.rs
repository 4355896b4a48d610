//! Motion planning of tensegrity structures and truss robots.
