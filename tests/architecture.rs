//! What the code may depend on. Absence cannot be seen in code, so it is written here and checked.

use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// The libraries in their order: each may use only those before it.
const SHARED: [&str; 14] = [
    "wide_loops",
    "chart",
    "geometry",
    "messages",
    "formats",
    "spectral",
    "morphology",
    "registration",
    "pose_graph",
    "scores",
    "learning",
    "simulation",
    "ipc",
    "stage",
];

/// Package name -> (folder under the root, names of its normal dependencies).
fn packages() -> BTreeMap<String, (String, Vec<String>)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(root)
        .output()
        .expect("cargo starts");
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let text = |value: &Value| value.as_str().expect("a string").to_owned();
    let package = |package: &Value| {
        let manifest = text(&package["manifest_path"]);
        let folder = Path::new(&manifest).parent().expect("a folder").strip_prefix(root).expect("inside");
        let dependencies = package["dependencies"].as_array().expect("a list").iter();
        let normal = dependencies.filter(|d| d["kind"].is_null()).map(|d| text(&d["name"])).collect();
        (text(&package["name"]), (folder.to_string_lossy().into_owned(), normal))
    };
    metadata["packages"].as_array().expect("a list").iter().map(package).collect()
}

#[test]
fn a_library_uses_only_those_before_it() {
    let packages = packages();
    for (index, name) in SHARED.iter().enumerate() {
        let (folder, dependencies) = &packages[*name];
        assert_eq!(*folder, format!("shared/{name}"), "folder and crate have one name");
        for dependency in dependencies {
            let ours = packages.contains_key(dependency);
            assert!(!ours || SHARED[..index].contains(&dependency.as_str()), "{name} must not use {dependency}");
        }
    }
}

#[test]
fn no_stage_knows_another() {
    let packages = packages();
    let services: Vec<&String> =
        packages.iter().filter(|(_, (folder, _))| folder.starts_with("services/")).map(|(name, _)| name).collect();
    assert!(services.len() >= 8, "{services:?}");
    for (name, (folder, dependencies)) in &packages {
        for dependency in dependencies {
            assert!(!services.contains(&dependency), "{name} must not use the service {dependency}");
        }
        if folder.starts_with("services/") {
            assert_eq!(*folder, format!("services/{name}"), "folder and crate have one name");
        }
    }
}

#[test]
fn iceoryx2_and_candle_are_known_to_one_crate_each() {
    for (name, (_, dependencies)) in packages() {
        for dependency in dependencies {
            assert!(!dependency.starts_with("iceoryx2") || name == "ipc", "{name} must not use {dependency}");
            assert!(!dependency.starts_with("candle") || name == "learning", "{name} must not use {dependency}");
        }
    }
}

#[test]
fn algorithms_do_not_know_how_messages_travel() {
    let packages = packages();
    for name in SHARED.iter().filter(|name| !["ipc", "stage"].contains(name)) {
        let (_, dependencies) = &packages[*name];
        for forbidden in ["ipc", "stage", "tracing"] {
            assert!(!dependencies.iter().any(|d| d == forbidden), "{name} must not use {forbidden}");
        }
    }
}

#[test]
fn somebody_elses_stage_needs_the_stage_crate_alone() {
    let packages = packages();
    let (_, dependencies) = &packages["height_segmenter"];
    assert_eq!(dependencies, &["stage"]);
}

#[test]
fn unsafe_code_stands_in_two_crates_only() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut folders = ["services", "shared", "tools", "tests", "examples"].map(|name| root.join(name)).to_vec();
    let mut allowed = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("readable").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = std::fs::read_to_string(&path).expect("text");
                // The lint denies unsafe code everywhere; only such a line can lift it.
                if text.contains(concat!("allow(", "unsafe_code")) {
                    let relative = path.strip_prefix(root).expect("inside").to_string_lossy().into_owned();
                    allowed.push(relative);
                }
            }
        }
    }
    allowed.sort();
    assert_eq!(allowed, ["shared/ipc/src/loan.rs", "shared/messages/src/pod.rs"]);
}
