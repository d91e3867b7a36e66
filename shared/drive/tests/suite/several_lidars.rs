//! `drive.toml` with several LiDARs.

use drive::manifest::Manifest;
use drive::{Drive, SweepSource};
use std::fs;
use std::path::Path;

const ENTRY: &str = "model = \"hdl64e\"\nformat = \"FORMAT\"\nbody_from_lidar = { translation = [0, 0, HEIGHT], rotation = [0, 0, 0, 1] }\n";

fn entry(name: &str, format: &str, folder: &str, height: &str) -> String {
    let entry = ENTRY.replace("FORMAT", format).replace("HEIGHT", height);
    format!("[[lidar]]\n{name}folder = \"{folder}\"\n{entry}")
}

fn write(folder: &Path, lidars: &str) {
    fs::write(folder.join("drive.toml"), format!("version = 1\nname = \"two\"\n{lidars}")).expect("writes");
}

/// Five clouds of one point per folder; the second begins 50 ms later.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, later) in [("a", 0), ("b", 50_000_000_i64)] {
        let path = folder.path().join(name);
        fs::create_dir_all(&path).expect("makes");
        let point: Vec<u8> = [5.0_f32, 0.0, 0.0, 0.5].iter().flat_map(|v| v.to_le_bytes()).collect();
        let times: Vec<String> = (0..5).map(|k| (k * 100_000_000 + later).to_string()).collect();
        (0..5).for_each(|k| fs::write(path.join(format!("{k}.bin")), &point).expect("writes"));
        fs::write(path.join("times.txt"), times.join("\n") + "\n").expect("writes");
    }
    folder
}

fn two(first: &str, second: &str) -> String {
    format!("{first}{second}")
}

#[test]
fn second_lidar_has_its_own_files_name_and_mounting() {
    let folder = folder();
    let text = two(&entry("name = \"main\"\n", "bin", "a", "1.9"), &entry("name = \"rear\"\n", "bin", "b", "1.5"));
    write(folder.path(), &text);
    let drive = Drive::open(folder.path()).expect("opens");
    assert_eq!(drive.lidars().map(|lidar| lidar.files.len()).collect::<Vec<_>>(), [5, 5]);
    assert_eq!(drive.rig().body_from_lidar.translation.z, 1.9);
    assert_eq!(drive.rig().body_from_other_lidars[0].translation.z, 1.5);
    assert_eq!((drive.manifest().lidar_name(0), drive.manifest().lidar_name(1)), ("main".into(), "rear".into()));
    let written = toml::to_string(drive.manifest()).expect("encodes");
    assert_eq!(&toml::from_str::<Manifest>(&written).expect("reads"), drive.manifest());
    // Clouds without times belong to the window of their stamp.
    let mut second = SweepSource::open(drive.lidars().nth(1).expect("there")).expect("opens");
    let mut stamps = Vec::new();
    for k in 0..6 {
        let window = [k * 100_000_000, (k + 1) * 100_000_000];
        stamps.push(second.next_slice(window, |_| {}).expect("reads").and_then(|slice| slice.stamp).map(|at| at.0));
    }
    let expected = [50, 150, 250, 350, 450].map(|ms| Some(ms * 1_000_000));
    assert_eq!(stamps[..5], expected);
    assert_eq!(stamps[5], None);
}

#[test]
fn one_lidar_may_be_a_table_or_the_only_one_of_an_array() {
    let folder = folder();
    let mut manifests = Vec::new();
    for head in ["[lidar]", "[[lidar]]"] {
        write(folder.path(), &entry("", "bin", "a", "1.9").replace("[[lidar]]", head));
        manifests.push(Drive::open(folder.path()).expect("opens").manifest().clone());
    }
    assert_eq!(manifests[0], manifests[1]);
    let written = toml::to_string(&manifests[0]).expect("encodes");
    assert!(written.contains("[lidar]\n") && !written.contains("[[lidar]]"), "{written}");
}

#[test]
fn lidars_that_cannot_be_told_apart_are_refused() {
    let folder = folder();
    let problems = |text: &str| -> Vec<String> {
        write(folder.path(), text);
        let error = Drive::open(folder.path()).expect_err("refused");
        error.problems.iter().map(|problem| format!("{}: {}", problem.key, problem.rule)).collect()
    };
    let named = |name: &str, format: &str, at: &str| entry(&format!("name = \"{name}\"\n"), format, at, "1");
    let found = problems(&two(&entry("", "bin", "a", "1"), &named("x y", "bin", "b")));
    assert!(found.len() == 2 && found[0].starts_with("lidar[0].name: must be a word"), "{found:?}");
    let found = problems(&two(&named("x", "bin", "a"), &named("x", "bin", "b")));
    assert!(
        found.len() == 1 && found[0].starts_with("lidar[1].name: value Some(\"x\") is also the name of lidar[0]"),
        "{found:?}"
    );
    let found = problems(&two(&named("x", "bin", "a"), &named("y", "bin", "a")));
    assert!(
        found.len() == 1 && found[0].starts_with("lidar[1].folder: \"a\" is also the folder of lidar[0]"),
        "{found:?}"
    );
    let found = problems(&two(&named("x", "pcap", "a"), &named("y", "pcap", "a")));
    assert!(
        found.iter().any(|text| text.starts_with("lidar[1].folder: \"a\" is also the folder of lidar[0]")),
        "{found:?}"
    );
    let five: String = (0..5).map(|k| named(&format!("l{k}"), "bin", if k == 0 { "a" } else { "b" })).collect();
    assert!(problems(&five)[0].starts_with("lidar: 5 LiDARs; at most 4"), "{:?}", problems(&five));
    assert_eq!(problems("lidar = []\n").len(), 1);
    let two_bad = two(&named("x", "bin", "a"), &named("y", "bin", "b").replace("hdl64e", "hdl65e"));
    assert!(problems(&two_bad)[0].starts_with("lidar[1].model: value \"hdl65e\""), "{:?}", problems(&two_bad));
}
