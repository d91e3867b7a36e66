//! Promises about the source tree: allowed dependencies of each crate, and the places of unsafe code.

mod promises;
mod wording;

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

fn read(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).expect("readable")
}

/// All files below a folder with one of these extensions, but for what builds and runs have made.
fn files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    const MADE: [&str; 7] = ["target", "node_modules", "dist", "out", "drives", ".git", "__pycache__"];
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).expect("readable").flatten() {
        let path = entry.path();
        if path.is_dir() {
            if !MADE.map(OsString::from).contains(&entry.file_name()) {
                found.extend(files(&path, extensions));
            }
        } else if path.extension().is_some_and(|extension| extensions.iter().any(|listed| extension == *listed)) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The libraries in the order of `workspace.dependencies` in Cargo.toml: each may use only those before it.
fn libraries() -> Vec<String> {
    let manifest = read("Cargo.toml");
    let (_, list) = manifest.split_once("[workspace.dependencies]\n").expect("a list");
    // The project's own crates come first; a blank line ends them.
    let own = list.split("\n\n").next().unwrap_or_default().lines();
    let is_library = |line: &(&str, &str)| line.1.contains("path = \"shared/");
    own.filter_map(|line| line.split_once(" = ")).filter(is_library).map(|(name, _)| name.to_owned()).collect()
}

#[test]
fn page_lists_the_libraries_in_their_order() {
    let page = read("ARCHITECTURE.md");
    let (_, list) = page.split_once("**A crate uses only crates above it in this list.**").expect("a list");
    let (_, rows) = list.split_once("| crate | content |\n|---|---|\n").expect("a table");
    let cells = rows.lines().take_while(|line| line.starts_with("| ")).filter_map(|line| line.split('|').nth(1));
    let listed: Vec<&str> = cells.flat_map(|cell| cell.split('`').skip(1).step_by(2)).collect();
    assert_eq!(listed, libraries());
}

/// What Cargo knows of the packages of the workspace.
fn metadata() -> Value {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo starts");
    serde_json::from_slice(&output.stdout).expect("JSON")
}

/// Package name -> (folder under the root, names of its normal dependencies).
fn packages() -> BTreeMap<String, (String, Vec<String>)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let metadata = metadata();
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
fn library_uses_only_earlier_ones() {
    let packages = packages();
    let libraries = libraries();
    assert!(libraries.len() >= 30, "{libraries:?}");
    let in_folder = packages.values().filter(|(folder, _)| folder.starts_with("shared/")).count();
    assert_eq!(libraries.len(), in_folder, "each library is listed once: {libraries:?}");
    for (index, name) in libraries.iter().enumerate() {
        let (folder, dependencies) = &packages[name];
        assert_eq!(*folder, format!("shared/{name}"), "folder and crate have one name");
        for dependency in dependencies {
            let ours = packages.contains_key(dependency);
            assert!(!ours || libraries[..index].contains(dependency), "{name} must not use {dependency}");
        }
    }
}

#[test]
fn services_are_independent() {
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
fn only_ipc_uses_iceoryx2_and_only_networks_use_candle() {
    for (name, (_, dependencies)) in packages() {
        for dependency in dependencies {
            assert!(!dependency.starts_with("iceoryx2") || name == "ipc", "{name} must not use {dependency}");
            // The last three read and write arrays of NumPy with it.
            let may_use_candle = ["kernels", "segmentation", "training", "replica_lab", "studies", "fuzz_targets"]
                .contains(&name.as_str());
            assert!(!dependency.starts_with("candle") || may_use_candle, "{name} must not use {dependency}");
        }
    }
}

#[test]
fn algorithms_are_independent_of_transport() {
    let packages = packages();
    for name in libraries().iter().filter(|name| !["ipc", "run", "link", "stage"].contains(&name.as_str())) {
        let (_, dependencies) = &packages[name];
        for forbidden in ["ipc", "run", "link", "stage", "tracing"] {
            assert!(!dependencies.iter().any(|d| d == forbidden), "{name} must not use {forbidden}");
        }
    }
}

/// A plain `cargo build` builds supervisor, stages and `replica`.
#[test]
fn product_needs_no_crate_of_the_laboratory() {
    let manifest = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("Cargo.toml")).expect("text");
    assert!(manifest.contains(r#"default-members = ["services/*", "tools/replica"]"#));
    let packages = packages();
    let is_product = |folder: &str| folder.starts_with("services/") || folder == "tools/replica";
    let product = packages.iter().filter(|(_, (folder, _))| is_product(folder));
    let mut todo: Vec<&str> = product.map(|(name, _)| name.as_str()).collect();
    let mut needed: BTreeSet<&str> = BTreeSet::new();
    while let Some(name) = todo.pop() {
        if let Some((_, dependencies)) = packages.get(name)
            && needed.insert(name)
        {
            todo.extend(dependencies.iter().map(String::as_str));
        }
    }
    assert!(needed.contains("stage") && needed.contains("replica"), "{needed:?}");
    for name in needed {
        let (folder, _) = &packages[name];
        let is_laboratory = folder.starts_with("lab/") || ["replica_lab", "training", "town_sweeps"].contains(&name);
        assert!(!is_laboratory, "the product must not use {name}");
    }
}

/// Targets without tests are not compiled a second time for them (`test = false` in Cargo.toml). A test in such a target would never
/// run.
#[test]
fn targets_that_are_not_tested_contain_no_tests() {
    let metadata = metadata();
    let mut n_targets = 0;
    for package in metadata["packages"].as_array().expect("a list") {
        let is_program = |kind: &Value| ["lib", "proc-macro", "bin", "cdylib"].map(Value::from).contains(kind);
        let targets = package["targets"].as_array().expect("a list").iter();
        let targets = targets.filter(|target| is_program(&target["kind"][0]));
        let (tested, untested): (Vec<&Value>, Vec<&Value>) = targets.partition(|target| target["test"] == true);
        for target in untested {
            n_targets += 1;
            let root = Path::new(target["src_path"].as_str().expect("a path"));
            // Modules belong to the tested target of the package, if there is one.
            let sources = if tested.is_empty() {
                files(root.parent().expect("a folder"), &["rs"])
            } else {
                vec![root.to_owned()]
            };
            for file in sources {
                let text = std::fs::read_to_string(&file).expect("text");
                let is_test = |line: &str| line.trim().starts_with("#[real_data::test(");
                let has_tests =
                    text.lines().any(|line| ["#[test]", "#[cfg(test)]"].contains(&line.trim()) || is_test(line));
                assert!(!has_tests, "{}: remove `test = false` from the target in Cargo.toml", file.display());
            }
        }
    }
    assert!(n_targets > 20, "{n_targets} targets without tests were found");
}

/// Packages that a build of this selection compiles, each with its features.
fn features(selection: &[&str]) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--locked", "--prefix", "none", "--format", "{p} with {f}"])
        .args(selection)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = String::from_utf8(output.stdout).expect("text");
    // A package that is listed again ends with an asterisk.
    lines.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).filter(|line| !line.is_empty()).collect()
}

/// One different feature of a low crate compiles everything above it again: four minutes for the wheel.
#[test]
fn commands_of_the_readme_and_the_wheel_compile_each_crate_once() {
    let tests = features(&["--workspace", "--edges", "normal,build,dev"]);
    for selection in [&[][..], &["-p", "replica-python"][..]] {
        let built = features(&[&["--edges", "normal,build"], selection].concat());
        assert!(built.len() > 100, "{built:?}");
        let others: Vec<&String> = built.difference(&tests).collect();
        assert!(others.is_empty(), "{selection:?} and the tests need different features of {others:?}");
    }
}

#[test]
fn foreign_stage_needs_only_the_stage_crate() {
    let packages = packages();
    let (_, dependencies) = &packages["height_segmenter"];
    assert_eq!(dependencies, &["stage"]);
}

#[test]
fn unsafe_code_stands_in_one_file_of_ipc() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = ["services", "shared", "tools", "tests", "examples", "lab", "benches"];
    // The lint denies unsafe code everywhere; only such a line can lift it.
    let allows =
        |path: &PathBuf| std::fs::read_to_string(path).expect("text").contains(concat!("allow(", "unsafe_code"));
    let files = folders.iter().flat_map(|name| files(&root.join(name), &["rs"])).filter(allows);
    let allowed: Vec<PathBuf> = files.map(|path| path.strip_prefix(root).expect("inside").to_owned()).collect();
    assert_eq!(allowed, [Path::new("shared/ipc/src/slot.rs")]);
}

/// Readers of files that users name open them by `files::regular_file`: a pipe in place of a file would hang a program.
#[test]
fn readers_open_files_by_the_helper() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    for name in ["drive", "formats", "import", "lidar", "recording", "rig", "segmentation", "spectral", "surveying"] {
        for path in files(&root.join("shared").join(name).join("src"), &["rs"]) {
            let text = std::fs::read_to_string(&path).expect("readable");
            let code = text.split("#[cfg(test)]").next().unwrap_or_default();
            let is_test = path.file_stem().is_some_and(|stem| stem.to_string_lossy().ends_with("_test"));
            let opens = ["File::open(", "fs::read(", "fs::read_to_string("].iter().any(|call| code.contains(call));
            if opens && !is_test {
                found.push(path.strip_prefix(root).expect("below").to_owned());
            }
        }
    }
    assert_eq!(found, Vec::<PathBuf>::new(), "use files::regular_file");
}

#[test]
fn crates_behind_a_step_deny_clocks_files_and_environment() {
    // These read and write files, start processes, or are the shell around a step.
    let shells = [
        "allocator",
        "file_server",
        "files",
        "formats",
        "lidar",
        "drive",
        "recording",
        "acquisition",
        "surveying",
        "scene",
        "import",
        "rig",
        "simulation",
        "town_sweeps",
        "ipc",
        "run",
        "link",
        "stage",
    ];
    // The sources read sensors and files; `remote` waits for another host; `launch` is not a stage.
    let others = ["acquire", "replay", "remote", "launch"];
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let libraries = libraries();
    for (name, (folder, _)) in packages() {
        let is_step_code = libraries.contains(&name) && !shells.contains(&name.as_str())
            || folder.starts_with("services/") && !others.contains(&name.as_str());
        if is_step_code {
            let text = std::fs::read_to_string(root.join(&folder).join("src/lib.rs")).expect("a library");
            // clippy.toml lists the methods.
            assert!(text.contains("deny(clippy::disallowed_methods)"), "{folder}/src/lib.rs");
        }
    }
}

/// Lines of code of the files below a folder: without tests, comments and blank lines.
fn lines_of_code(folder: &Path) -> usize {
    let lines_of_file = |path: &PathBuf| {
        let text = std::fs::read_to_string(path).expect("text");
        let code = text.lines().map(str::trim).take_while(|line| *line != "#[cfg(test)]");
        code.filter(|line| !line.is_empty() && !line.starts_with("//")).count()
    };
    files(folder, &["rs"]).iter().map(lines_of_file).sum()
}

/// Crates that a stage may use in addition to the project's crates: for its saved state, its errors, and the threads of
/// parallel loops. Matrices, images, files and networks belong in libraries.
const OF_STAGES: [&str; 3] = ["rayon", "serde", "thiserror"];

/// Largest number of lines of code of a stage. The longest have 500: the settings and ports of three sensors, or of all
/// columns. The limit leaves room for a line per name, but not for an algorithm.
const MAX_STAGE_LINES: usize = 700;

#[test]
fn stages_wire_ports_and_leave_computation_to_libraries() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let packages = packages();
    let mut n_stages = 0;
    for (name, (folder, dependencies)) in &packages {
        // `launch` supervises the stages; `remote` is a proxy for one.
        if !folder.starts_with("services/") || ["launch", "remote"].contains(&name.as_str()) {
            continue;
        }
        n_stages += 1;
        for dependency in dependencies {
            let may_use = packages.contains_key(dependency) || OF_STAGES.contains(&dependency.as_str());
            assert!(may_use, "{folder} must not use {dependency}: move what needs it into a library");
        }
        let n_lines = lines_of_code(&root.join(folder).join("src"));
        assert!(
            (50..MAX_STAGE_LINES).contains(&n_lines),
            "{folder}/src has {n_lines} lines of code: move ideas into a library"
        );
    }
    assert!(n_stages >= 8, "{n_stages} stages were found");
}
