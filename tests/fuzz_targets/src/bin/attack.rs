//! `attack`: runs a target on seeded mutations of its corpus with a limit on memory and, on request, on instructions.
//!
//! A panic, an abort or a stack overflow ends the process. `--progress` names a file that then contains the number of the input;
//! `--save` writes that input to a file.

use cap::Cap;
use clap::Parser;
use fuzz_targets::{
    TARGETS, corpus, input, instruction_limit, instructions, memory_limit, processor_time, suspicious_time, target,
};
use std::alloc::System;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, usize::MAX);

/// Runs a target on seeded mutations of its corpus.
#[derive(Parser)]
struct Args {
    /// Name of the target; without it, all targets
    target: Option<String>,
    /// Seed of the mutations
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Number of the first input
    #[arg(long, default_value_t = 0)]
    from: u64,
    /// Inputs for each target
    #[arg(long, default_value_t = 2000)]
    count: u64,
    /// Time for each target, s; ends before `count`
    #[arg(long, default_value_t = f64::INFINITY)]
    seconds: f64,
    /// Fail at an input for which the target executes more instructions than allowed; counts instructions of slow
    /// inputs under valgrind
    #[arg(long)]
    limit_work: bool,
    /// File that contains the number of the current input
    #[arg(long)]
    progress: Option<PathBuf>,
    /// Write the first input to this file and end
    #[arg(long)]
    save: Option<PathBuf>,
}

fn main() -> ExitCode {
    let args = Args::parse();
    for (name, _) in TARGETS.iter().filter(|(name, _)| args.target.as_deref().is_none_or(|wanted| wanted == *name)) {
        if let Err(error) = attack(name, &args) {
            eprintln!("{name}: {error}");
            return ExitCode::FAILURE;
        }
    }
    if args.target.as_deref().is_some_and(|name| target(name).is_none()) {
        eprintln!("no such target; known: {}", TARGETS.map(|(name, _)| name).join(" "));
        return ExitCode::from(2);
    }
    ExitCode::SUCCESS
}

fn attack(name: &str, args: &Args) -> std::io::Result<()> {
    let Some(run) = target(name) else { return Ok(()) };
    let corpus = corpus(name)?;
    if let Some(path) = &args.save {
        return std::fs::write(path, input(&corpus, args.seed, args.from));
    }
    let progress = args.progress.as_ref().map(std::fs::File::create).transpose()?;
    let begin = Instant::now();
    let mut n = 0;
    let mut slowest = (Duration::ZERO, 0);
    while n < args.count && begin.elapsed().as_secs_f64() < args.seconds {
        let number = args.from + n;
        let bytes = input(&corpus, args.seed, number);
        if let Some(file) = &progress {
            file.write_all_at(&number.to_le_bytes(), 0)?;
        }
        let called = processor_time();
        // An allocation beyond the limit fails, which aborts the process unless the reader handles it.
        let _ = MEMORY.set_limit(MEMORY.allocated() + memory_limit(&bytes));
        run(&bytes);
        let _ = MEMORY.set_limit(usize::MAX);
        let used = processor_time().saturating_sub(called);
        if args.limit_work && used > suspicious_time(&bytes) {
            let limit = instruction_limit(&bytes);
            let executed = instructions_of_input(name, args.seed, number)?;
            if executed > limit {
                let problem =
                    format!("input {number}, {} bytes: {executed} instructions; at most {limit}", bytes.len());
                return Err(std::io::Error::other(problem));
            }
        }
        slowest = slowest.max((used, number));
        n += 1;
    }
    let (slowest, number) = slowest;
    let seconds = begin.elapsed().as_secs_f64();
    println!("{name}: {n} executions in {seconds:.1} s; slowest {} ms (input {number})", slowest.as_millis());
    Ok(())
}

/// Instructions of one call: the count of a process with the input, minus the count of a process without.
fn instructions_of_input(name: &str, seed: u64, number: u64) -> std::io::Result<u64> {
    let seed = seed.to_string();
    let number = number.to_string();
    let of_count = |count: &str| instructions(&[name, "--seed", &seed, "--from", &number, "--count", count]);
    Ok(of_count("1")?.saturating_sub(of_count("0")?))
}
