//! Standard output, whose reader may have left.

use std::{
    fmt::Arguments,
    io::{ErrorKind, Write, stdout},
};

/// Prints a line on standard output, like `println!`, but does not panic when
/// nobody reads it any more, as in `tensegra info … | head`.
macro_rules! say {
    () => {
        $crate::output::line(format_args!(""))
    };
    ($($part:tt)*) => {
        $crate::output::line(format_args!($($part)*))
    };
}

/// Prints a line. Ends the program where it cannot be written, but not where the
/// reader has left: files are still to be written, and the exit status still counts.
pub fn line(text: Arguments<'_>) {
    if let Err(error) = writeln!(stdout(), "{text}")
        && error.kind() != ErrorKind::BrokenPipe
    {
        eprintln!("error: cannot write to standard output: {error}");
        std::process::exit(2);
    }
}
