//! The lab's program: hands its arguments to the command line of the lab.

fn main() -> std::process::ExitCode {
    patina::run_lab(std::env::args_os())
}
