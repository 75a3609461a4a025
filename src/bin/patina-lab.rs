//! The lab's program: hands its arguments to the command line of the lab.

/// Counts what is allocated, for `patina-lab fuzz`.
#[global_allocator]
static ALLOCATOR: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;

fn main() -> std::process::ExitCode {
    patina::run_lab(std::env::args_os())
}
