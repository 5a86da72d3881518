//! `print`, `println` and `eprintln` for programs whose output may be closed by the reader, as in `region |
//! head -3`.
//!
//! The standard library's macros panic on a closed pipe. These macros end the program with success and
//! without a message, since the reader has what it wanted. A program imports them with `use
//! visibility_examples::{eprintln, print, println}`, which hides the standard ones. It must write its files
//! before it prints, or call [`go_on_without_reader`].

use std::fmt::{Arguments, Display};
use std::io::{ErrorKind, Write};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether the program goes on after the reader has closed an output.
static GOES_ON: AtomicBool = AtomicBool::new(false);

/// From now on, what is printed to a closed output is lost, and the program goes on to write its files.
/// Without this call, it ends with success.
pub fn go_on_without_reader() {
    GOES_ON.store(true, Ordering::Relaxed);
}

/// Returns the exit code of a program. Prints an error to standard error.
pub fn exit_code(done: Result<(), impl Display>) -> ExitCode {
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            crate::eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Prints to standard output like `std::print`. Ends the program if the output is closed.
#[macro_export]
macro_rules! print {
    ($($arguments:tt)*) => {
        $crate::print::write(::std::io::stdout(), ::std::format_args!($($arguments)*))
    };
}

/// Prints a line to standard output like `std::println`. Ends the program if the output is closed.
#[macro_export]
macro_rules! println {
    () => { $crate::print!("\n") };
    ($($arguments:tt)*) => { $crate::print!("{}\n", ::std::format_args!($($arguments)*)) };
}

/// Prints a line to standard error like `std::eprintln`. Ends the program if standard error is closed.
#[macro_export]
macro_rules! eprintln {
    ($($arguments:tt)*) => {
        $crate::print::write(
            ::std::io::stderr(),
            ::std::format_args!("{}\n", ::std::format_args!($($arguments)*)),
        )
    };
}

/// Writes `text`. If this fails, ends the program: with success if the reader has closed the stream, unless
/// the program [goes on](go_on_without_reader); otherwise (such as on a full disk) with failure. For the
/// macros of this module.
pub fn write(mut stream: impl Write, text: Arguments<'_>) {
    if let Err(error) = stream.write_fmt(text) {
        let is_closed = error.kind() == ErrorKind::BrokenPipe;
        if !is_closed || !GOES_ON.load(Ordering::Relaxed) {
            std::process::exit(i32::from(!is_closed));
        }
    }
}
