//! The program: hands its arguments to the command line of the library.

fn main() -> std::process::ExitCode {
    patina::run_command_line(std::env::args_os())
}
