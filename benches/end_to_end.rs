//! The whole pipeline on the sample drive, several times: speed, CPU seconds by stage, memory. The drive is simulated if it
//! does not exist. `cargo build --release && cargo bench -p replica-tests --bench end_to_end [-- RUNS]`

use serde_json::Value;
use std::path::Path;
use std::process::Command;

fn run(root: &Path, output: &Path) -> Value {
    let status = Command::new(root.join("target/release/replica-launch"))
        .arg(root.join("launch.toml"))
        .arg("--overwrite")
        .arg("--set")
        .arg(format!("run.output={}", output.display()))
        .stderr(std::process::Stdio::null())
        .status()
        .expect("built by `cargo build --release`");
    // The sample drive is too short to find north, which is a doubt.
    assert!(matches!(status.code(), Some(0 | 3)), "{status}");
    serde_json::from_slice(&std::fs::read(output.join("summary.json")).expect("written")).expect("JSON")
}

fn main() {
    let runs = std::env::args().find_map(|argument| argument.parse().ok()).unwrap_or(5);
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().expect("a folder");
    run(root, folder.path()); // simulates the drive if needed, and warms the caches
    let mut summaries: Vec<Value> = (0..runs).map(|_| run(root, folder.path())).collect();
    let number = |value: &Value| value.as_f64().expect("a number");
    summaries.sort_by(|a, b| number(&a["total"]["wall_s"]).total_cmp(&number(&b["total"]["wall_s"])));
    let median = &summaries[summaries.len() / 2];
    let total = &median["total"];
    assert_eq!(median["outcome"], "done");
    println!("median of {runs} runs, {:.1} s of drive, {} points", number(&total["drive_s"]), total["points"]);
    println!(
        "{:.2} s: {:.2} times real time, {:.2} M points/s, {:.2} s of CPU, {:.0} MB of shared memory at most",
        number(&total["wall_s"]),
        number(&total["times_real_time"]),
        number(&total["points_per_s"]) * 1e-6,
        number(&total["cpu_s"]),
        number(&total["peak_shared_memory_bytes"]) * 1e-6
    );
    println!("\n| stage | CPU s | step p50 ms | step p99 ms | peak memory MB |\n|---|---|---|---|---|");
    for stage in median["stages"].as_array().expect("a list") {
        println!(
            "| {} | {:.2} | {:.1} | {:.1} | {:.0} |",
            stage["name"].as_str().expect("a name"),
            number(&stage["cpu_s"]),
            number(&stage["step"]["p50_ms"]),
            number(&stage["step"]["p99_ms"]),
            number(&stage["peak_rss_bytes"]) * 1e-6
        );
    }
}
