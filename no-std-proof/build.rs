//! Leaves the C runtime out, which would bring an entry point and a libc of its own.

fn main() {
    for argument in ["-nostartfiles", "-static", "-no-pie", "-nostdlib"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}
