//! Where the processor time of each stage goes: one run under `perf`, which Linux distributions have as a package.

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};

/// Samples a second and thread. Not a divisor of any rate in the pipeline.
const SAMPLES_PER_S: &str = "997";

/// Functions of each stage in the report.
const N_FUNCTIONS: usize = 10;

/// The kernel cuts the name of a process to this length.
const NAME_CHARS: usize = 15;

/// Libraries whose functions are named by the type of this project that they work on.
const LIBRARIES: [&str; 7] = ["core", "alloc", "std", "rayon", "rayon_core", "pulp", "hashbrown"];

/// The most expensive functions of a process.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ProcessProfile {
    /// Its program, as the kernel cuts it.
    pub name: String,
    /// Samples in all of its threads.
    pub samples: usize,
    /// Share of the samples in the kernel.
    pub kernel_share: f64,
    /// Share of the samples and name of a function, without the functions that it calls.
    pub functions: Vec<(f64, String)>,
}

/// The command that records the activity of a program and its children into `data`.
pub fn recording(data: &Path, program: &Path) -> Command {
    let mut command = Command::new("perf");
    command.args(["record", "--quiet", "-F", SAMPLES_PER_S, "-o"]).arg(data).arg("--").arg(program);
    command
}

/// Fails if `perf` is missing, before the first measurement.
pub fn check() -> anyhow::Result<()> {
    let found = Command::new("perf").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    if !found.is_ok_and(|status| status.success()) {
        bail!("--profile needs the program perf: install it (Debian: linux-perf), or leave --profile out");
    }
    Ok(())
}

/// Reads what [`recording()`] wrote.
pub fn read(data: &Path) -> anyhow::Result<Vec<ProcessProfile>> {
    let args: [OsString; 5] = ["script".into(), "-i".into(), data.into(), "-F".into(), "comm,pid,tid,ip,sym".into()];
    let output = Command::new("perf").args(args).output().context("perf script")?;
    if !output.status.success() {
        bail!("perf script: {}", String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(profiles(&String::from_utf8_lossy(&output.stdout)))
}

/// One sample.
#[derive(Debug, PartialEq)]
struct Sample<'a> {
    thread_name: &'a str,
    pid: u32,
    tid: u32,
    in_kernel: bool,
    function: &'a str,
}

/// `COMM PID/TID ADDRESS FUNCTION`; a thread's name may contain spaces.
fn sample(line: &str) -> Option<Sample<'_>> {
    let (before, after) = line.split_once('/')?;
    let (thread_name, pid) = before.rsplit_once(' ')?;
    let (tid, after) = after.split_once(' ')?;
    let (address, function) = after.trim_start().split_once(' ')?;
    let pid = pid.parse().ok()?;
    let tid = tid.parse().ok()?;
    Some(Sample { thread_name: thread_name.trim(), pid, tid, in_kernel: address.starts_with("ffff"), function })
}

/// Profiles by program, summed over its processes: stages are also started before a run to describe ports and settings.
fn profiles(script: &str) -> Vec<ProcessProfile> {
    let samples: Vec<Sample<'_>> = script.lines().filter_map(sample).collect();
    let is_main = |sample: &&Sample<'_>| sample.pid == sample.tid && sample.thread_name.starts_with("replica-");
    let programs: BTreeMap<u32, &str> =
        samples.iter().filter(is_main).map(|sample| (sample.pid, sample.thread_name)).collect();
    let mut of_programs: BTreeMap<&str, Vec<&Sample<'_>>> = BTreeMap::new();
    for sample in &samples {
        if let Some(program) = programs.get(&sample.pid) {
            of_programs.entry(program).or_default().push(sample);
        }
    }
    of_programs.into_iter().map(|(program, samples)| profile(program, &samples)).collect()
}

fn profile(program: &str, samples: &[&Sample<'_>]) -> ProcessProfile {
    let share = |n: usize| n as f64 / samples.len().max(1) as f64;
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    for sample in samples {
        let kernel = if sample.in_kernel { "kernel: " } else { "" };
        *counts.entry(format!("{kernel}{}", short_name(sample.function))).or_default() += 1;
    }
    let mut functions: Vec<_> = counts.into_iter().collect();
    functions.sort_by(|(a, n_a), (b, n_b)| n_b.cmp(n_a).then(a.cmp(b)));
    functions.truncate(N_FUNCTIONS);
    ProcessProfile {
        name: program.to_owned(),
        samples: samples.len(),
        kernel_share: share(samples.iter().filter(|sample| sample.in_kernel).count()),
        functions: functions.into_iter().map(|(name, n)| (share(n), name)).collect(),
    }
}

/// The name without type arguments. A function of a library is named by the first type of another crate among them, and its own
/// last word: `coloring::choice::Weigh (vectorize)`. Names of programs with `-Csymbol-mangling-version=v0` have such arguments.
fn short_name(name: &str) -> String {
    let is_path = |c: char| c.is_alphanumeric() || "_:{}#".contains(c);
    let path = |text: &str| text.split_once("::{").map_or(text, |(path, _)| path).trim_matches(':').to_owned();
    let is_library = |text: &str| LIBRARIES.contains(&text.split("::").next().unwrap_or_default());
    let mut paths = name.split(|c| !is_path(c)).filter(|text| text.contains("::") && !text.starts_with("::")).map(path);
    let (Some(first), own) = (paths.next(), paths.find(|text| !is_library(text))) else {
        return name.to_owned();
    };
    let method = |name: &str| name.split(['<', '>', ' ']).find_map(|part| part.strip_prefix("::")).map(path);
    match own {
        Some(own) if is_library(&first) => {
            let function =
                if name.contains("vectorize") { "vectorize" } else { first.rsplit("::").next().unwrap_or_default() };
            format!("{own} ({function})")
        }
        _ if name.starts_with('<') => method(name).map_or(first.clone(), |method| format!("{first}::{method}")),
        _ => first,
    }
}

/// A table for each stage, in the order of `stages`.
pub fn markdown<'a>(profiles: &[ProcessProfile], stages: impl Iterator<Item = &'a str>) -> String {
    let mut text = String::from(
        "\n## Profile\n\nShare of the samples of each stage, by function, without the functions that it calls.\n",
    );
    for stage in stages {
        let program: String = format!("replica-{stage}").chars().take(NAME_CHARS).collect();
        let Some(profile) = profiles.iter().find(|profile| profile.name == program) else { continue };
        // Writing to a string cannot fail, here and below.
        let _ = write!(
            text,
            "\n{stage}: {} samples, {:.0} % in the kernel\n\n```\n",
            profile.samples,
            100.0 * profile.kernel_share
        );
        for (share, function) in &profile.functions {
            let _ = writeln!(text, "{:5.1} %  {function}", 100.0 * share);
        }
        text += "```\n";
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCRIPT: &str = "\
   replica-infer 609/609      560ce379d50c core::iter::Map<I, F>::next
   replica-infer 609/617      560ce3775f68 engine::convolve
 my thread 609/618      ffffffff8117 do_fault
   replica-infer 609/617      560ce3775f70 engine::convolve
   sh 700/700      55cb8f7e3dfe main
";

    #[test]
    fn samples_of_all_threads_count_for_their_process() {
        let found = profiles(SCRIPT);
        assert_eq!(found.len(), 1);
        assert_eq!((found[0].name.as_str(), found[0].samples, found[0].kernel_share), ("replica-infer", 4, 0.25));
        assert_eq!(found[0].functions[0], (0.5, "engine::convolve".to_owned()));
        assert_eq!(found[0].functions[2], (0.25, "kernel: do_fault".to_owned()));
        let text = markdown(&found, ["acquire", "infer"].into_iter());
        assert!(
            text.contains("infer: 4 samples, 25 % in the kernel") && text.contains(" 50.0 %  engine::convolve"),
            "{text}"
        );
    }

    #[test]
    fn names_lose_type_arguments_and_libraries() {
        for (name, short) in [
            ("formats::jpeg::check", "formats::jpeg::check"),
            ("__memset_avx512", "__memset_avx512"),
            ("<formats::jpeg::huffman::Huffman>::next", "formats::jpeg::huffman::Huffman::next"),
            ("<zune_jpeg::bitstream::BitStream>::decode::<&[u8]>", "zune_jpeg::bitstream::BitStream::decode"),
            (
                "<pulp::x86::v4::V4>::vectorize::imp::<<pulp::x86::v4::V4 as pulp::Simd>::vectorize::Impl<coloring::choice::Weigh>>",
                "coloring::choice::Weigh (vectorize)",
            ),
            (
                "rayon::iter::plumbing::helper::<rayon::slice::IterProducer<coloring::spectra::Batch>, ()>",
                "coloring::spectra::Batch (helper)",
            ),
            ("core::hash::sip::write", "core::hash::sip::write"),
        ] {
            assert_eq!(short_name(name), short);
        }
    }

    #[test]
    fn processes_of_one_program_count_together() {
        let found = profiles(&format!("{SCRIPT}   replica-infer 500/500      560ce3775f70 engine::convolve\n"));
        assert_eq!((found.len(), found[0].samples), (1, 5));
    }

    #[test]
    fn line_that_is_no_sample_is_left_out() {
        for line in ["", "replica-infer", "a/b", "replica-infer 1/x 0 f", "replica-infer 1/2 7f"] {
            assert_eq!(sample(line), None, "{line}");
        }
    }
}
