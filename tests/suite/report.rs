//! The report of a run: written at its end, about this run, and without any effect on it.

use replica_tests::{Launch, binary, drive, gate, output_text, pipeline};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

const FILES: [&str; 2] = ["report.html", "report.json"];
const SOURCE: &str = "ticks = 20\npoints = 500";

fn written(launch: &Launch) -> Vec<PathBuf> {
    FILES.iter().map(|name| launch.output().join(name)).filter(|path| path.exists()).collect()
}

fn facts(file: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(file).expect("was written")).expect("JSON")
}

#[test]
fn run_ends_with_a_report_that_names_its_doubts() {
    let launch = pipeline(&drive(), "report = true", "").with("--set").with("colorize.min_colored_share=1.0");
    let output = launch.run();
    let said = output_text(&output);
    assert_eq!(output.status.code(), Some(3), "{said}");
    let facts = facts(&launch.output().join(FILES[1]));
    let summary = launch.summary();
    assert_eq!((&facts["verdict"]["level"], &facts["verdict"]["exit_code"]), (&"amber".into(), &3.into()));
    assert_eq!(facts["points"]["n"], summary["total"]["points"]);
    let doubt = &facts["doubts"][0];
    assert_eq!((&doubt["stage"], &doubt["name"]), (&"colorize".into(), &"few_points_colored".into()));
    let sensors = facts["input"]["sensors"].as_array().expect("a list");
    assert!(sensors.iter().any(|sensor| sensor["name"] == "imu"), "{sensors:?}");
    assert!(facts["path"]["length_m"].as_f64() > Some(5.0), "{}", facts["path"]);

    // Two seconds of fixes place no path.
    assert!(facts["accuracy"]["absolute"].is_null(), "{}", facts["accuracy"]);

    let page = String::from_utf8(launch.read(FILES[0])).expect("text");
    let first = page.find("Absolute accuracy: unknown").zip(page.find("Exit code"));
    assert!(first.is_some_and(|(accuracy, verdict)| accuracy < verdict), "the accuracy comes first");
    let text = doubt["text"].as_str().expect("text");
    assert!(page.contains(text), "{text}");
    assert_eq!(page.matches("data:image/png").count(), 4, "three views from above and a range image");
    assert!(page.matches("data:image/jpeg").count() >= 6, "points over the images of most cameras");
    assert!(["hs02: ", "hs03: "].iter().all(|camera| page.contains(camera)), "and of both mosaic cameras");
    let external = ["<script", "src=\"http", "href=\"http", "@import"];
    assert!(external.iter().all(|word| !page.contains(word)), "the page needs no other file");
    assert!(page.len() < 5_000_000, "{} bytes", page.len());

    // The report depends only on the files of the run and its drive.
    let before = FILES.map(|name| launch.read(name));
    let folder = launch.output().canonicalize().expect("is there");
    let again = Command::new(binary("replica")).arg("report").arg(&folder).output().expect("starts");
    assert!(again.status.success(), "{}", output_text(&again));
    assert!(FILES.map(|name| launch.read(name)) == before, "the second report differs");
}

#[test]
fn report_that_cannot_be_written_is_a_warning() {
    let launch = Launch::misbehaving("report = true", SOURCE, "");
    // The temporary path of the report before it gets its name.
    std::fs::create_dir_all(launch.output().join(".report.json.partial/a")).expect("made");
    let output = launch.run();
    let said = output_text(&output);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("no report: ") && said.contains("`replica report "), "{said}");
    assert_eq!(launch.summary()["outcome"], "done");
    assert!(written(&launch).is_empty(), "{:?}", written(&launch));
}

#[test]
fn interrupted_run_has_no_report_of_an_earlier_one() {
    let relay = gate(12);
    let launch = Launch::misbehaving("report = true", SOURCE, &relay);
    launch.open_gate();
    assert_eq!(launch.run().status.code(), Some(0));
    assert_eq!(written(&launch).len(), 2);
    std::fs::remove_file(launch.folder().join("gate")).expect("removed");
    let launch = launch.with("--overwrite");
    launch.kill_at_barrier(1, &["source", "relay", "sink"]);
    assert!(written(&launch).is_empty(), "{:?}", written(&launch));
}

#[test]
fn failed_run_has_a_red_report_and_the_setting_turns_it_off() {
    let fault = "fault = \"error\"\nat_tick = 3";
    for (run, n_files) in [("restarts = 0\nreport = true", 2), ("restarts = 0\nreport = false", 0)] {
        let launch = Launch::misbehaving(run, SOURCE, fault);
        let output = launch.run();
        assert_eq!(output.status.code(), Some(1), "{}", output_text(&output));
        assert_eq!(written(&launch).len(), n_files);
        let again = Command::new(binary("replica")).arg("report").arg(launch.output()).output().expect("starts");
        assert!(again.status.success(), "{}", output_text(&again));
        assert_eq!(facts(&launch.output().join(FILES[1]))["verdict"]["level"], "red");
    }
}

#[test]
#[cfg_attr(not(chromium), ignore = "needs Chromium: apt-get install chromium")]
fn browser_shows_every_section_of_the_page() {
    let launch = pipeline(&drive(), "report = true", "");
    assert_eq!(launch.run().status.code(), Some(0));
    let picture = launch.folder().join("page.png");
    let page = format!("file://{}", launch.output().join(FILES[0]).display());
    let profile = tempfile::tempdir().expect("a folder");
    let browser = |action: &str| {
        let quiet =
            ["--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic"];
        let output = Command::new("chromium")
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--window-size=1000,3000"])
            .args(quiet)
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .args([action, &page])
            .stdin(Stdio::null())
            .output()
            .expect("starts");
        assert!(output.status.success(), "{}", output_text(&output));
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let shown = browser("--dump-dom");
    for section in ["Input", "Path", "Top views", "Calibration", "Reflectances", "Classes", "Repeat the run"] {
        assert!(shown.contains(&format!("<h2>{section}</h2>")), "{section}");
    }
    // Elements after an unclosed one would be inside it.
    assert!(shown.trim_end().ends_with("</body></html>"));
    assert_eq!(shown.matches("<figure>").count(), shown.matches("</figure>").count());
    browser(&format!("--screenshot={}", picture.display()));
    // White alone has a few kB.
    assert!(std::fs::metadata(&picture).expect("was drawn").len() > 100_000);
}
