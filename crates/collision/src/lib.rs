//! Shapes, clearances with witness points and normals, swept checks.
