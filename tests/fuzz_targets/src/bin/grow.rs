//! `grow`: runs targets on inputs of 32 KiB and of 512 KiB, in which a piece of a corpus is repeated, and reports those whose time grows
//! faster than their size. Quadratic time does not show in the short inputs of a fuzzer, and stacks do not overflow.

use clap::Parser;
use fuzz_targets::{TARGETS, corpus, processor_time, target};
use random::Random;
use std::process::ExitCode;
use std::time::Duration;

const SMALL: usize = 32 << 10;
const LARGE: usize = 512 << 10;
/// Shorter times of small inputs are noise.
const LEAST: Duration = Duration::from_millis(1);
/// The time may grow so much more than the size: by caches, sorting and noise.
const MAX_GROWTH: f64 = 4.0;

/// Reports readers whose time grows faster than their input.
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
        for number in 0..args.count {
            let mut random = Random::of_stream(args.seed, number);
            let Some(file) = (!files.is_empty()).then(|| random.pick(&files)) else { break };
            let (at, n) = piece(file, &mut random);
            let is_numbered = random.chance(0.3);
            let [small, large] = [SMALL, LARGE].map(|size| repeated(file, at, n, size, is_numbered));
            let [of_small, of_large] = [&small, &large].map(|input| time(*run, input));
            let size = large.len() as f64 / small.len() as f64;
            let growth = of_large.as_secs_f64() / of_small.max(LEAST).as_secs_f64() / size;
            most = most.max(growth);
            if growth > MAX_GROWTH {
                is_linear = false;
                let text = String::from_utf8_lossy(&file[at..at + n]);
                println!("{name}: {of_small:?} for {} bytes, {of_large:?} for {}: {text:?}", small.len(), large.len());
            }
        }
        println!("{name}: {} pieces; time grows {most:.2} times as much as the size at most", args.count);
    }
    if is_linear { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Begin and length of some lines or bytes of a file.
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

/// The file with a piece so often that it has about `size` bytes. `is_numbered`: digits of the pieces are replaced by their number, so
/// that names differ.
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
