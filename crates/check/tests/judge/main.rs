//! Verdicts on configurations and paths that are known in closed form.

mod configuration;
mod input;
mod motion;
mod structures;
