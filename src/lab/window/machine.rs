//! What the system tells of this process: time of its threads, memory, load. Linux tells; elsewhere it is not known.

use std::path::Path;

/// Seconds of processor time since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProcessorSeconds {
    /// Of all threads, those that ended included.
    pub all: f64,
    /// Of threads named `patina-fit…` that live.
    pub fit: f64,
}

/// Where and on what was measured.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Machine {
    /// Logical processors.
    pub processors: usize,
    /// Model of the processor; empty where the system does not tell.
    pub processor: String,
    /// What draws.
    pub adapter: String,
    /// Whether the processor draws in place of a graphics card.
    pub is_software: bool,
    /// Size of the window in pixels.
    pub window_pixels: [u32; 2],
    /// Processes that wanted a processor over the last minute, before the bench began.
    pub load_before: Option<f64>,
    /// The same at its end; the bench itself is in it.
    pub load_after: Option<f64>,
    /// Share of the machine's time in [0, 1] that other processes took while the bench ran; they disturb its figures.
    pub taken_by_others: Option<f64>,
    /// Whether this is an optimised build.
    pub is_optimised: bool,
}

impl Machine {
    /// This machine as it is now, without a window.
    pub fn here() -> Self {
        Machine {
            processors: std::thread::available_parallelism().map_or(1, |count| count.get()),
            processor: processor(),
            load_before: load(),
            load_after: load(),
            is_optimised: !cfg!(debug_assertions),
            ..Machine::default()
        }
    }
}

/// Ticks a second in which Linux counts the time of processes, on every machine in use.
const TICKS_PER_SECOND: f64 = 100.0;

/// Processor time of this process.
pub fn processor_seconds() -> Option<ProcessorSeconds> {
    let all = ticks_of_process(&read("/proc/self/stat")?)? as f64 / TICKS_PER_SECOND;
    let mut fit = 0.0;
    for task in std::fs::read_dir("/proc/self/task").ok()?.flatten() {
        let path = task.path();
        let name = read(path.join("comm")).unwrap_or_default();
        if name.starts_with("patina-fit") {
            let nanoseconds = read(path.join("schedstat")).and_then(|text| text.split(' ').next()?.parse::<f64>().ok());
            fit += nanoseconds.unwrap_or(0.0) * 1e-9;
        }
    }
    Some(ProcessorSeconds { all, fit })
}

/// User and system time, the 14th and 15th field; the name in brackets before them may hold blanks.
fn ticks_of_process(stat: &str) -> Option<u64> {
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    Some(fields.get(11)?.parse::<u64>().ok()? + fields.get(12)?.parse::<u64>().ok()?)
}

/// Seconds since the start in which processors of the machine were busy, for whomever.
pub fn busy_seconds_of_machine() -> Option<f64> {
    let text = read("/proc/stat")?;
    let fields: Vec<f64> =
        text.lines().next()?.split_whitespace().skip(1).filter_map(|word| word.parse().ok()).collect();
    // User, nice, system, idle, waiting, interrupts, soft interrupts, stolen.
    let busy = [0, 1, 2, 5, 6, 7].iter().filter_map(|&field| fields.get(field)).sum::<f64>();
    Some(busy / TICKS_PER_SECOND)
}

/// Memory of this process that is in place, in bytes.
pub fn resident_bytes() -> Option<u64> {
    let text = read("/proc/self/status")?;
    let rest = text.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    rest.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// Threads of this process whose names begin so.
pub fn threads_named(prefix: &str) -> Option<usize> {
    let tasks = std::fs::read_dir("/proc/self/task").ok()?.flatten();
    Some(tasks.filter(|task| read(task.path().join("comm")).is_some_and(|name| name.starts_with(prefix))).count())
}

/// Open files of this process.
pub fn open_files() -> Option<usize> {
    Some(std::fs::read_dir("/proc/self/fd").ok()?.count())
}

/// Processes that wanted a processor over the last minute.
pub fn load() -> Option<f64> {
    read("/proc/loadavg")?.split(' ').next()?.parse().ok()
}

/// Model of the processor.
pub fn processor() -> String {
    let text = read("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name"));
    model.and_then(|rest| rest.split_once(':')).map(|(_, name)| name.trim().to_owned()).unwrap_or_default()
}

fn read(path: impl AsRef<Path>) -> Option<String> {
    std::fs::read_to_string(path).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fields_are_found_behind_a_strange_name() {
        let stat = "7 (a b) c) R 1 2 3 4 5 6 7 8 9 10 120 34 0 0 20 0 8 0";
        assert_eq!(ticks_of_process(stat), Some(154));
        assert_eq!(ticks_of_process("7 (x) R 1"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn work_on_a_thread_of_the_fit_is_counted_there() {
        let before = processor_seconds().unwrap();
        let (go, wait) = std::sync::mpsc::channel::<()>();
        let (done, told) = std::sync::mpsc::channel::<()>();
        let thread = std::thread::Builder::new().name("patina-fit-test".into()).spawn(move || {
            let began = std::time::Instant::now();
            while began.elapsed().as_secs_f64() < 0.2 {
                std::hint::black_box(began);
            }
            done.send(()).unwrap();
            wait.recv().unwrap();
        });
        told.recv().unwrap();
        assert!(processor_seconds().unwrap().fit > before.fit);
        assert_eq!(threads_named("patina-fit-test"), Some(1));
        go.send(()).unwrap();
        thread.unwrap().join().unwrap();
        assert!(resident_bytes().unwrap() > 1 << 20 && open_files().unwrap() > 2);
    }
}
