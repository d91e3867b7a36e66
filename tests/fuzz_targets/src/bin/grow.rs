//! `grow`: runs targets on inputs of 32 KiB and of 512 KiB, in which a piece of a corpus is repeated, and reports
//! targets whose work grows faster than their size. The short inputs of a fuzzer neither reveal quadratic work nor
//! overflow stacks.
//!
//! Work is counted in instructions, under valgrind, where the time grows faster than the size.

use clap::Parser;
use fuzz_targets::{TARGETS, corpus, instructions, processor_time, target};
use random::Random;
use std::process::ExitCode;
use std::time::Duration;

const SMALL: usize = 32 << 10;
const LARGE: usize = 512 << 10;
/// Least time of a small input. Shorter times are noise.
const LEAST: Duration = Duration::from_millis(1);
/// Least number of instructions of a small input. Fewer are overhead: as many as [`LEAST`] allows.
const LEAST_INSTRUCTIONS: u64 = 3_000_000;
/// Largest growth of instructions relative to size, e.g. by sorting. A larger growth of time is suspicious: caches and
/// other programs add to it.
const MAX_GROWTH: f64 = 4.0;

/// Reports readers whose work grows faster than their input.
#[derive(Parser)]
struct Args {
    /// Name of the target; without it, all targets
    target: Option<String>,
    /// Seed of the choice of pieces
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Pieces for each target
    #[arg(long, default_value_t = 40)]
    count: u64,
    /// Number of the first piece
    #[arg(long, default_value_t = 0)]
    from: u64,
    /// Run the pieces once at this size, bytes, and compare nothing
    #[arg(long)]
    size: Option<usize>,
}

fn main() -> ExitCode {
    let args = Args::parse();
    if args.target.as_deref().is_some_and(|name| target(name).is_none()) {
        eprintln!("no such target; known: {}", TARGETS.map(|(name, _)| name).join(" "));
        return ExitCode::from(2);
    }
    let mut is_linear = true;
    for (name, run) in TARGETS.iter().filter(|(name, _)| args.target.as_deref().is_none_or(|wanted| wanted == *name)) {
        let mut files = corpus(name).unwrap_or_default();
        files.retain(|file| !file.is_empty() && file.len() < SMALL);
        let mut most = 0.0_f64;
        for number in args.from..args.from + args.count {
            let mut random = Random::for_stream(args.seed, number);
            let Some(file) = (!files.is_empty()).then(|| random.pick(&files)) else { break };
            let (at, n) = piece(file, &mut random);
            let is_numbered = random.chance(0.3);
            if let Some(size) = args.size {
                run(&repeated(file, at, n, size, is_numbered));
                continue;
            }
            let [small, large] = [SMALL, LARGE].map(|size| repeated(file, at, n, size, is_numbered));
            let size = large.len() as f64 / small.len() as f64;
            let [of_small, of_large] = [&small, &large].map(|input| time(*run, input));
            let growth = of_large.as_secs_f64() / of_small.max(LEAST).as_secs_f64() / size;
            most = most.max(growth);
            if growth <= MAX_GROWTH {
                continue;
            }
            let counts = [SMALL, LARGE].map(|size| instructions_of_piece(name, args.seed, number, size));
            let [of_small, of_large] = match counts {
                [Ok(of_small), Ok(of_large)] => [of_small, of_large],
                [Err(error), _] | [_, Err(error)] => {
                    eprintln!("{name}: {error}");
                    return ExitCode::FAILURE;
                }
            };
            if of_large as f64 / of_small.max(LEAST_INSTRUCTIONS) as f64 / size > MAX_GROWTH {
                is_linear = false;
                let text = String::from_utf8_lossy(&file[at..at + n]);
                let [small, large] = [small.len(), large.len()];
                println!("{name}: {of_small} instructions for {small} bytes, {of_large} for {large}: {text:?}");
            }
        }
        println!("{name}: {} pieces; time grows {most:.2} times as much as the size at most", args.count);
    }
    if is_linear { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Instructions of one call with a piece at a size: the count of a process with the call, minus the count of a process
/// without.
fn instructions_of_piece(name: &str, seed: u64, number: u64, size: usize) -> std::io::Result<u64> {
    let seed = seed.to_string();
    let number = number.to_string();
    let size = size.to_string();
    let of_count =
        |count: &str| instructions(&[name, "--seed", &seed, "--from", &number, "--size", &size, "--count", count]);
    Ok(of_count("1")?.saturating_sub(of_count("0")?))
}

/// Start and length of some lines or bytes of a file.
fn piece(file: &[u8], random: &mut Random) -> (usize, usize) {
    let ends = file.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(at, _)| at + 1);
    let lines: Vec<usize> = std::iter::once(0).chain(ends).filter(|at| *at < file.len()).collect();
    if lines.len() > 1 && random.chance(0.5) {
        let line = random.index(lines.len());
        let end = lines.get(line + 1 + random.index(6)).copied().unwrap_or(file.len());
        return (lines[line], end - lines[line]);
    }
    let at = random.index(file.len());
    let longest = if random.chance(0.5) { 4 } else { 200 };
    (at, (1 + random.index(longest)).min(file.len() - at))
}

/// The file with a piece repeated until it has about `size` bytes. `is_numbered`: digits of the pieces are replaced by
/// their number, so that names differ.
fn repeated(file: &[u8], at: usize, n: usize, size: usize, is_numbered: bool) -> Vec<u8> {
    let mut bytes = file[..at].to_vec();
    let mut number = 0_u32;
    while bytes.len() + file.len() < size {
        for byte in &file[at..at + n] {
            if is_numbered && byte.is_ascii_digit() {
                bytes.extend(number.to_string().bytes());
            } else {
                bytes.push(*byte);
            }
        }
        number += 1;
    }
    bytes.extend(&file[at..]);
    bytes
}

fn time(run: fn(&[u8]), input: &[u8]) -> Duration {
    let begin = processor_time();
    run(input);
    processor_time().saturating_sub(begin)
}
