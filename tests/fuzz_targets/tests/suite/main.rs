//! The short form of fuzzing: 2000 mutations of each target's corpus, without panic and within the memory limit.

use fuzz_targets::{TARGETS, corpus};
use std::process::Command;

/// Largest size of all corpora, bytes: they are in the source tree.
const MAX_CORPUS: usize = 200_000;

#[test]
fn readers_survive_mutated_input_within_their_memory_limit() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut findings = Vec::new();
    for (name, _) in TARGETS {
        let progress = folder.path().join(name);
        let mut attack = Command::new(env!("CARGO_BIN_EXE_attack"));
        let output = attack.arg(name).arg("--progress").arg(&progress).output().expect("attack starts");
        if !output.status.success() {
            let number = std::fs::read(&progress).ok().and_then(|bytes| bytes.try_into().ok()).map(u64::from_le_bytes);
            let text = String::from_utf8_lossy(&output.stderr);
            findings.push(format!("{name}: input {number:?}: {}: {text}", output.status));
        }
    }
    assert!(
        findings.is_empty(),
        "save an input with `attack TARGET --from NUMBER --save FILE`\n{}",
        findings.join("\n")
    );
}

#[test]
fn every_target_has_a_small_corpus() {
    let mut n_bytes = 0;
    for (name, _) in TARGETS {
        let files = corpus(name).expect("a corpus");
        assert!(!files.is_empty(), "{name}");
        n_bytes += files.iter().map(Vec::len).sum::<usize>();
    }
    assert!(n_bytes < MAX_CORPUS, "{n_bytes} bytes");
}

#[test]
fn every_target_is_a_program_of_cargo_fuzz() {
    let manifest = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/Cargo.toml");
    let text = std::fs::read_to_string(manifest).expect("is there");
    let programs: Vec<&str> = text.split("[[bin]]").skip(1).filter_map(|program| program.split('"').nth(1)).collect();
    assert_eq!(programs, TARGETS.map(|(name, _)| name));
}
