//! `print`, `println` and `eprintln` for programs whose readers may leave: `region | head -3`.
//!
//! The standard library's macros panic when nobody reads any more. These end the program, without a message
//! and with success, since the reader has what it wanted. Programs take them by `use
//! visibility_examples::{eprintln, print, println}`, which hides the standard ones, and write their files
//! before they print.

use std::fmt::{Arguments, Display};
use std::io::{ErrorKind, Write};
use std::process::ExitCode;

/// Returns the exit code of a program, after an error was printed to standard error.
pub fn exit_code(done: Result<(), impl Display>) -> ExitCode {
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            crate::eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Prints to standard output, as `std::print` does. Ends the program if nobody reads.
#[macro_export]
macro_rules! print {
    ($($arguments:tt)*) => {
        $crate::print::write(::std::io::stdout(), ::std::format_args!($($arguments)*))
    };
}

/// Prints a line to standard output, as `std::println` does. Ends the program if nobody reads.
#[macro_export]
macro_rules! println {
    () => { $crate::print!("\n") };
    ($($arguments:tt)*) => { $crate::print!("{}\n", ::std::format_args!($($arguments)*)) };
}

/// Prints a line to standard error, as `std::eprintln` does. Ends the program if nobody reads.
#[macro_export]
macro_rules! eprintln {
    ($($arguments:tt)*) => {
        $crate::print::write(
            ::std::io::stderr(),
            ::std::format_args!("{}\n", ::std::format_args!($($arguments)*)),
        )
    };
}

/// Writes `text`, and ends the program if that fails: with success if the reader has left, otherwise, as on a
/// full disk, with failure. For the macros of this module.
pub fn write(mut stream: impl Write, text: Arguments<'_>) {
    if let Err(error) = stream.write_fmt(text) {
        std::process::exit(i32::from(error.kind() != ErrorKind::BrokenPipe));
    }
}
