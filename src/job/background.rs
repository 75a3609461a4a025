//! Work beside a window: threads of its own that give way to the one that draws.
//!
//! A window paints its pictures on the usual pool of threads. Work that shares that pool would make it wait until a step
//! of a fit is over, and work of the same priority takes half of its time: so work gets a pool of its own, of lower
//! priority. Where nothing is drawn it has the processors all the same.

use rayon::{ThreadPool, ThreadPoolBuilder};

/// What is added to the niceness of a thread that works: beside one of the usual priority it gets about a tenth.
#[cfg(target_os = "linux")]
const NICENESS: i32 = 10;

/// Lets the calling thread, and no other, give way to threads of the usual priority. Only Linux can do that to one thread;
/// elsewhere nothing happens.
pub fn give_way() {
    #[cfg(target_os = "linux")]
    // A system that refuses leaves the priority as it is.
    let _ = rustix::process::nice(NICENESS);
}

/// A pool of as many threads as the usual one, which give way; `None` when the system gives no threads.
pub fn pool(name: &'static str) -> Option<ThreadPool> {
    ThreadPoolBuilder::new()
        .num_threads(rayon::current_num_threads())
        .thread_name(move |index| format!("{name}-{index}"))
        .start_handler(|_| give_way())
        .build()
        .ok()
}

/// Runs work that a person waits for on a pool of its own, at the usual priority: the window paints on its own threads
/// meanwhile, and opening takes as long as on the command line.
pub fn run_beside<T: Send>(name: &'static str, work: impl FnOnce() -> T + Send) -> T {
    let pool = ThreadPoolBuilder::new()
        .num_threads(rayon::current_num_threads())
        .thread_name(move |index| format!("{name}-{index}"))
        .build();
    match pool {
        Ok(pool) => pool.install(work),
        Err(_) => work(),
    }
}

/// Runs work on a pool of its own, which gives way; on the usual threads where there is none to be had.
pub fn run<T: Send>(name: &'static str, work: impl FnOnce() -> T + Send) -> T {
    match pool(name) {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    #[test]
    fn work_gives_way_and_its_results_are_those_of_the_usual_threads() {
        let square = |number: u64| number * number;
        let usual: Vec<u64> = (0..1000u64).into_par_iter().map(square).collect();
        let (beside, threads) = run("patina-test", || {
            ((0..1000u64).into_par_iter().map(square).collect::<Vec<_>>(), rayon::current_num_threads())
        });
        assert_eq!((beside, threads), (usual, rayon::current_num_threads()));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn only_the_threads_of_the_pool_give_way() {
        let niceness = || {
            let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
            stat.rsplit_once(") ").unwrap().1.split(' ').nth(16).unwrap().parse::<i32>().unwrap()
        };
        let own = niceness();
        assert_eq!(run_beside("patina-test", niceness), own);
        let beside = run("patina-test", niceness);
        assert!(beside > own || own > 9, "{beside} beside {own}");
        assert_eq!(niceness(), own);
    }
}
