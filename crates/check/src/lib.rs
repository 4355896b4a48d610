//! The independent judge of a planned path.
