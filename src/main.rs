//! The program: hands its arguments to the command line of the library.

fn main() -> std::process::ExitCode {
    patina::cli::run(std::env::args_os())
}
