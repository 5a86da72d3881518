//! Build script that leaves out the C runtime, which would bring an entry point and a libc.

fn main() {
    for argument in ["-nostartfiles", "-static", "-no-pie", "-nostdlib"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}
