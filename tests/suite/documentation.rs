//! The pages under `docs/` agree with the tree: links resolve, commands have the options that the pages show, and the
//! settings page equals the descriptions of the stages.

use replica_tests::binary;
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Component, Path, PathBuf};
use std::process::Command;

/// The stages in the order of the pipeline.
const STAGES: [&str; 8] =
    ["acquire", "calibrate", "slam_aggregate", "colorize", "infer", "instance", "export", "replay"];

/// Set to rewrite the settings page instead of comparing it.
const WRITE: &str = "REPLICA_WRITE_DOCS";

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every page: in the root, next to code, and under `docs/` and `lab/notebook/`.
fn pages() -> Vec<PathBuf> {
    let root = root();
    let beside_code =
        ["benches", "lab", "lab/experiments", "lab/peers", "fuzz", "models", "shared/simulation/rigs", "tools/viewer"]
            .map(|folder| root.join(folder).join("README.md"));
    let mut pages: Vec<PathBuf> = ["README.md", "ARCHITECTURE.md", "CHANGELOG.md"].map(|page| root.join(page)).into();
    pages.extend(beside_code);
    let mut folders = vec![root.join("docs"), root.join("lab/notebook")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("the folder is readable") {
            let path = entry.expect("the folder is readable").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "md") {
                pages.push(path);
            }
        }
    }
    pages.sort();
    pages
}

/// The lines of a page outside of code blocks.
fn prose(page: &Path) -> Vec<String> {
    let text = fs::read_to_string(page).expect("a page is UTF-8 text");
    let mut in_code = false;
    let mut lines = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            in_code = !in_code;
        } else if !in_code {
            lines.push(line.to_owned());
        }
    }
    lines
}

/// The anchors that GitHub generates from the headings of a page.
fn anchors(page: &Path) -> BTreeSet<String> {
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut anchors = BTreeSet::new();
    for line in prose(page) {
        let title = line.trim_start_matches('#');
        if title.len() == line.len() || !title.starts_with(' ') {
            continue;
        }
        let is_kept = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
        let anchor = title.trim().to_lowercase().chars().filter(is_kept).collect::<String>().replace(' ', "-");
        let count = counts.entry(anchor.clone()).or_default();
        anchors.insert(if *count == 0 { anchor } else { format!("{anchor}-{count}") });
        *count += 1;
    }
    anchors
}

/// The targets of the links of a page, without links to other sites.
fn links(page: &Path) -> Vec<String> {
    let text = prose(page).join("\n");
    let without_code: Vec<&str> = text.split('`').step_by(2).collect();
    let text = without_code.join(" ");
    let targets = text.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target);
    targets.filter(|target| !target.contains("://")).map(str::to_owned).collect()
}

/// `folder/../file` without the detour.
fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for component in path.components() {
        match component {
            Component::ParentDir => drop(normal.pop()),
            other => normal.push(other),
        }
    }
    normal
}

#[test]
fn every_link_of_the_documentation_resolves() {
    let mut broken = Vec::new();
    for page in pages() {
        for link in links(&page) {
            let (path, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = match path {
                "" => page.clone(),
                path => normal(&page.parent().expect("a page lies in a folder").join(path)),
            };
            let is_page = target.extension().is_some_and(|extension| extension == "md");
            if !target.exists() {
                broken.push(format!("{}: {link}: no such file", page.display()));
            } else if is_page && !anchor.is_empty() && !anchors(&target).contains(anchor) {
                broken.push(format!("{}: {link}: no such heading", page.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// The command lines in the shell blocks of a page, without comments.
fn command_lines(page: &Path) -> Vec<String> {
    let text = fs::read_to_string(page).expect("a page is UTF-8 text").replace("\\\n", " ");
    let blocks = text.split("```sh\n").skip(1).filter_map(|rest| rest.split_once("```"));
    let lines = blocks.flat_map(|(block, _)| block.lines().map(str::to_owned).collect::<Vec<_>>());
    let without_comment = |line: String| line.split(" #").next().unwrap_or_default().trim().to_owned();
    let commands = |line: String| line.split(['|', ';', '&', '(', ')']).map(str::to_owned).collect::<Vec<_>>();
    lines.map(without_comment).flat_map(commands).filter(|line| !line.starts_with('#')).collect()
}

/// The help of a command about its options, by the words that select it.
fn help(program: &str, words: &[&str]) -> Option<String> {
    let output = Command::new(binary(program)).args(words).arg("--help").output().expect("starts");
    output.status.success().then(|| String::from_utf8(output.stdout).expect("UTF-8"))
}

#[test]
fn options_of_the_commands_in_the_documentation_exist() {
    let mut unknown = Vec::new();
    let mut n_checked = 0;
    for page in pages() {
        for line in command_lines(&page) {
            let words: Vec<&str> = line.split_whitespace().map(|word| word.trim_matches(['[', ']', '\''])).collect();
            let Some((program, arguments)) = words.split_first() else { continue };
            let program = program.rsplit('/').next().unwrap_or_default();
            if !["replica", "replica-lab", "replica-launch"].contains(&program) {
                continue;
            }
            // `replica-lab evaluate map`: the options of both.
            let n_words = if program == "replica-launch" { 0 } else { 2 };
            let selected: Vec<&str> = arguments
                .iter()
                .copied()
                .take(n_words)
                .take_while(|word| word.starts_with(|c: char| c.is_ascii_lowercase()))
                .take_while(|word| word.chars().all(|c| c.is_ascii_lowercase() || c == '-'))
                .collect();
            let texts: Vec<String> = (0..=selected.len()).filter_map(|n| help(program, &selected[..n])).collect();
            let options = arguments.iter().filter(|word| word.starts_with("--") && word.len() > 2);
            for option in options.map(|word| word.split('=').next().unwrap_or_default()) {
                n_checked += 1;
                let is_known =
                    |text: &String| text.split([' ', '\n', '=', ',', '[', '<', ']']).any(|word| word == option);
                if !texts.iter().any(is_known) {
                    unknown.push(format!("{}: {option} in `{line}`", page.display()));
                }
            }
        }
    }
    assert!(unknown.is_empty(), "{}", unknown.join("\n"));
    assert!(n_checked > 100, "{n_checked} options were found");
}

#[test]
fn settings_page_matches_the_stages_descriptions() {
    let page = root().join("docs/reference/settings.md");
    let expected = settings_page();
    if std::env::var_os(WRITE).is_some() {
        fs::write(&page, &expected).expect("docs/reference is writable");
    }
    let found = fs::read_to_string(&page).unwrap_or_default();
    let hint = format!("{} is out of date: run this test with {WRITE}=1 to rewrite it", page.display());
    assert!(found == expected, "{hint}");
}

/// The page of all settings, from every stage's `--describe`.
fn settings_page() -> String {
    let mut text = String::from(
        "# Settings of the stages\n\n\
         Look up the default, the allowed values and the meaning of every setting.\n\n\
         <!-- Generated from `replica-<stage> --describe` by the test settings_page_matches_the_stages_descriptions; \
         rewrite it with REPLICA_WRITE_DOCS=1. -->\n\n\
         A stage reads its own table of [launch.toml](launch_file.md). Keys that every table has are \
         [there](launch_file.md#keys-of-every-stage-table).\n\n\
         A default shows the type: `1.0` is a float, `1` an integer, `[]` a list. Without a rule, every value of the type is allowed.\n",
    );
    for stage in STAGES {
        let output = Command::new(binary(&format!("replica-{stage}"))).arg("--describe").output();
        let output = output.unwrap_or_else(|error| panic!("replica-{stage} --describe: {error}"));
        let description: Value = serde_json::from_slice(&output.stdout).expect("--describe prints JSON");
        let _ = write!(text, "\n## {stage}\n\n| key | default | allowed | meaning |\n|---|---|---|---|\n");
        for setting in description["settings"].as_array().expect("settings are a list") {
            let column = |key: &str| setting[key].as_str().expect("a column is text").replace('|', "\\|");
            let key = column("key");
            let default = column("default");
            let rule = column("rule");
            let allowed = rule.strip_prefix("must be ").unwrap_or(&rule);
            let meaning = column("meaning");
            let _ = writeln!(text, "| `{key}` | `{default}` | {allowed} | {meaning} |");
        }
    }
    text
}
