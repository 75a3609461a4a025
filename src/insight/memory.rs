//! Peak memory of this process.

/// The largest resident memory so far in bytes (`VmHWM`); `None` where the system does not tell.
pub fn peak_bytes() -> Option<u64> {
    peak_of_status(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// Finds the line `VmHWM:  1234 kB`.
fn peak_of_status(status: &str) -> Option<u64> {
    let rest = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = rest.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_is_found_and_a_strange_one_is_not_a_number() {
        assert_eq!(peak_of_status("Name:\tx\nVmHWM:\t    2048 kB\nVmRSS:\t 1 kB\n"), Some(2048 * 1024));
        assert_eq!(peak_of_status("VmHWM:\t many kB\n"), None);
        assert_eq!(peak_of_status(""), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn memory_that_was_touched_shows() {
        let block = vec![1u8; 64 << 20];
        assert!(std::hint::black_box(&block).iter().step_by(4096).map(|&b| u64::from(b)).sum::<u64>() > 0);
        assert!(peak_bytes().unwrap() > 64 << 20);
    }
}
