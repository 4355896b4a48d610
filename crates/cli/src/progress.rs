//! Progress of a long search, on standard error when it is a terminal.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use tensegra::{
    prelude::{Observer, Progress},
    sampling::{SmoothObserver, SmoothProgress},
};

/// A spinner that shows how far planning has come.
pub struct Spinner {
    bar: Option<ProgressBar>,
    shown: Instant,
}

impl Spinner {
    /// A spinner with a label; silent where standard error is no terminal.
    pub fn new(label: &str) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new_spinner();
            if let Ok(style) = ProgressStyle::with_template("{spinner} {prefix}: {msg}") {
                bar.set_style(style);
            }
            bar.set_prefix(label.to_owned());
            bar
        });
        Self {
            bar,
            shown: Instant::now(),
        }
    }
}

impl Spinner {
    /// A spinner that turns by itself, for work that does not report how far it has come.
    pub fn steady(label: &str) -> Self {
        let spinner = Self::new(label);
        if let Some(bar) = &spinner.bar {
            bar.enable_steady_tick(Duration::from_millis(100));
        }
        spinner
    }
}

impl Drop for Spinner {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Observer for Spinner {
    fn progress(&mut self, progress: &Progress) -> bool {
        if let Some(bar) = &self.bar
            && self.shown.elapsed() > Duration::from_millis(100)
        {
            self.shown = Instant::now();
            bar.set_message(format!(
                "{:.1} s, {} charts, {} nodes",
                progress.seconds, progress.charts, progress.nodes
            ));
            bar.tick();
        }
        true
    }
}

impl SmoothObserver for Spinner {
    fn progress(&mut self, progress: &SmoothProgress) -> bool {
        if let Some(bar) = &self.bar
            && self.shown.elapsed() > Duration::from_millis(100)
        {
            self.shown = Instant::now();
            bar.set_message(format!(
                "smoothing, {:.1} s, {} iterations, length {:.3}, optimality {:.1e}",
                progress.seconds, progress.iterations, progress.length, progress.optimality
            ));
            bar.tick();
        }
        true
    }
}
