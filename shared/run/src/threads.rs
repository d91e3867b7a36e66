//! Number of threads of parallel loops, with a bound: an environment that asks for a hundred thousand threads would stop
//! the machine. The results do not depend on the number.

/// Variables from which `rayon` takes the number of threads, in its order.
const VARIABLES: [&str; 2] = ["RAYON_NUM_THREADS", "RAYON_RS_NUM_CPUS"];

/// Threads per processor, and on any machine: more have no use, fewer would exclude tests of other machines.
const MAX_PER_PROCESSOR: usize = 4;
const MIN_BOUND: usize = 16;

/// The largest number of threads of a process on this machine.
pub fn max_threads() -> usize {
    let n_processors = std::thread::available_parallelism().map_or(1, usize::from);
    (n_processors * MAX_PER_PROCESSOR).max(MIN_BOUND)
}

/// The number that replaces the one of the environment. `None`: the environment does not set it, or within the bound.
pub fn bounded_environment() -> Option<usize> {
    bounded(|name| std::env::var(name).ok(), max_threads())
}

fn bounded(variable: impl Fn(&str) -> Option<String>, max: usize) -> Option<usize> {
    let numbers = VARIABLES.iter().filter_map(|name| variable(name)?.trim().parse::<usize>().ok());
    // Zero: one thread per processor.
    numbers.into_iter().find(|number| *number > 0).filter(|number| *number > max).map(|_| max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn number_of_the_environment_has_a_bound() {
        let environment = |first: &'static str, second: &'static str| {
            move |name: &str| Some(if name == VARIABLES[0] { first } else { second }.to_owned())
        };
        assert_eq!(bounded(|_| None, 16), None);
        assert_eq!(bounded(environment("16", "100000"), 16), None);
        assert_eq!(bounded(environment("17", ""), 16), Some(16));
        assert_eq!(bounded(environment("100000", ""), 16), Some(16));
        assert_eq!(bounded(environment("0", "100000"), 16), Some(16));
        assert_eq!(bounded(environment("many", "100000"), 16), Some(16));
        assert!(max_threads() >= MIN_BOUND);
    }
}
