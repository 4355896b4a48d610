//! Implicit manifolds: charts, exponential and logarithmic maps, continuation, atlases.
