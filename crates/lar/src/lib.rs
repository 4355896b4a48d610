//! Linear-actuator (truss) robots: rigidity, kinematics, locomotion and motion primitives.
