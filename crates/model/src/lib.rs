//! What a tensegrity is: structure, problem files, statics and its equilibrium manifold.
