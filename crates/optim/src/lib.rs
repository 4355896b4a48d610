//! Numerical optimisation: quasi-Newton methods, penalty method, least squares, sparse SQP.
