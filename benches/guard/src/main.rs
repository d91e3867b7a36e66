//! Counts the instructions of kernels on fixed inputs and compares them with `benches/guard/limits.toml`:
//! `cargo run --release --locked -p guard [-- --update | -- --only WORD]`. Needs valgrind.
//!
//! A count is repeatable to a few instructions whatever else the machine does, so unlike a time it can fail a build. It
//! does not include waiting for memory, for other threads and for the disk. Valgrind offers AVX2 at most, so AVX2 code
//! is counted, on one thread.
//!
//! Exit codes: 0 = within the limits, 1 = a limit was exceeded, 2 = nothing was measured.

mod kernels;
mod limits;
mod street;

use anyhow::{Context, bail, ensure};
use kernels::{KERNELS, N_COUNTED, N_WARM};
use limits::Limits;
use std::process::{Command, ExitCode};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let outcome = match arguments[..] {
        ["--rounds", name, rounds] => run(name, rounds).map(|()| true),
        [] => compare("", false),
        ["--only", word] => compare(word, false),
        ["--update"] => compare("", true),
        _ => Err(anyhow::anyhow!("usage: guard [--update | --only WORD]")),
    };
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("{error:#}");
            ExitCode::from(2)
        }
    }
}

/// The counted process.
fn run(name: &str, rounds: &str) -> anyhow::Result<()> {
    // The main thread is the only one of the pool: idle threads would spin.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()?;
    let (_, prepare) = KERNELS.iter().find(|(known, _)| *known == name).context("no such kernel")?;
    let mut round = prepare().with_context(|| name.to_owned())?;
    for _ in 0..rounds.parse()? {
        round().with_context(|| name.to_owned())?;
    }
    Ok(())
}

/// Prints the table. Returns whether all counts are within the limits.
fn compare(word: &str, update: bool) -> anyhow::Result<bool> {
    ensure!(
        std::arch::is_x86_feature_detected!("avx2"),
        "the limits are for AVX2 code, which this processor does not run"
    );
    let mut limits = Limits::load()?;
    let mut good = true;
    println!("{:<40}{:>14}{:>14}{:>9}", "kernel, instructions of one round", "now", "recorded", "ratio");
    for (name, _) in KERNELS.iter().filter(|(name, _)| name.contains(word)) {
        let n = (instructions(name, N_WARM + N_COUNTED)? - instructions(name, N_WARM)?) / u64::from(N_COUNTED);
        let recorded = limits.instructions.insert((*name).to_owned(), n);
        let ratio = recorded.map(|recorded| n as f64 / recorded as f64);
        let verdict = match ratio {
            None if !update => "  NOT RECORDED",
            Some(ratio) if ratio > limits.max_ratio && !update => "  EXCEEDED",
            _ => "",
        };
        good &= verdict.is_empty();
        let recorded = recorded.map_or_else(|| "-".to_owned(), |recorded| recorded.to_string());
        let ratio = ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{ratio:.3}"));
        println!("{name:<40}{n:>14}{recorded:>14}{ratio:>9}{verdict}");
    }
    if update {
        limits.save()?;
    } else if !good {
        println!("limit: {} of the recorded count; --update records these counts", limits.max_ratio);
    }
    Ok(good)
}

/// Instructions of a process that runs a kernel, preparation included.
fn instructions(name: &str, rounds: u32) -> anyhow::Result<u64> {
    let program = std::env::current_exe()?;
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .arg(program)
        .args(["--rounds", name, &rounds.to_string()])
        .output()
        .context("valgrind does not start: apt-get install valgrind")?;
    let text = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        bail!("{name}: {}: {text}", output.status);
    }
    let count = text.lines().find_map(|line| line.split_once("Collected : ")?.1.trim().parse().ok());
    count.with_context(|| format!("{name}: valgrind printed no count: {text}"))
}
