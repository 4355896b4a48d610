//! Sampling-based planners over implicit manifolds.
