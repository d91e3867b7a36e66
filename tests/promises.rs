//! `docs/promises.md` and the tests are consistent. Part of the test binary `architecture`.

use super::files;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const PAGE: &str = "docs/promises.md";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The code spans of the page that name a test: `module::…::function`.
fn named_tests() -> BTreeSet<String> {
    let page = std::fs::read_to_string(root().join(PAGE)).expect("the page exists");
    let is_test = |span: &&str| {
        let is_name = |part: &str| {
            !part.is_empty() && part.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_')
        };
        span.contains("::") && span.split("::").all(is_name)
    };
    // Code spans are the odd pieces between back-ticks.
    let spans = page.split('`').skip(1).step_by(2);
    spans.filter(is_test).map(str::to_owned).collect()
}

/// The test functions of a source file.
fn tests_of(file: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(file).expect("a source file");
    let mut tests = Vec::new();
    let mut is_marked = false;
    for line in text.lines().map(str::trim_start) {
        is_marked |= line.starts_with("#[test]") || line.starts_with("#[real_data::test");
        if let Some(rest) = line.strip_prefix("fn ") {
            if is_marked {
                tests.extend(rest.split('(').next().map(str::to_owned));
            }
            is_marked = false;
        }
    }
    tests
}

/// The files in which a test of this path may be: a module of the suite, or files of a crate below the module's name.
fn files_with_module(path: &[&str]) -> Vec<PathBuf> {
    let (crate_or_module, modules) = path.split_first().expect("a path");
    let of_suite = root().join(format!("tests/suite/{crate_or_module}.rs"));
    if modules.is_empty() && of_suite.is_file() {
        return vec![of_suite];
    }
    let mut found = Vec::new();
    if *crate_or_module == "architecture" {
        found.extend(["tests/architecture.rs", "tests/promises.rs", "tests/wording.rs"].map(|file| root().join(file)));
    }
    let folders = ["shared", "services", "tools", "lab", "."].map(|folder| root().join(folder).join(crate_or_module));
    found.extend(folders.iter().filter(|folder| folder.is_dir()).flat_map(|folder| files(folder, &["rs"])));
    // A module is a file or a folder.
    let has_module = |file: &PathBuf, module: &str| {
        file.file_stem().is_some_and(|stem| stem == module)
            || file.parent().is_some_and(|folder| folder.ends_with(module))
    };
    found.retain(|file| modules.iter().all(|module| has_module(file, module)));
    found
}

#[test]
fn named_tests_exist() {
    let absent: Vec<String> = named_tests()
        .into_iter()
        .filter(|name| {
            let parts: Vec<&str> = name.split("::").collect();
            let (test, path) = parts.split_last().expect("a name");
            !files_with_module(path).iter().any(|file| tests_of(file).iter().any(|found| found == test))
        })
        .collect();
    assert!(absent.is_empty(), "{PAGE} names tests that do not exist: {absent:#?}");
}

/// The tests of the Python package, and the tests that the page names.
#[test]
fn python_tests_are_listed() {
    let mut tests = BTreeSet::new();
    for entry in std::fs::read_dir(root().join("tools/python/tests")).expect("a folder").flatten() {
        let text = std::fs::read_to_string(entry.path()).unwrap_or_default();
        let names = text.lines().filter_map(|line| line.strip_prefix("def test_")?.split('(').next());
        tests.extend(names.map(|name| format!("test_{name}")));
    }
    let page = std::fs::read_to_string(root().join(PAGE)).expect("the page exists");
    let named = page.split('`').skip(1).step_by(2).filter(|span| span.starts_with("test_"));
    let named: BTreeSet<String> = named.map(str::to_owned).collect();
    assert!(!tests.is_empty());
    assert_eq!(tests, named, "{PAGE} must list the tests of tools/python/tests");
}

#[test]
fn process_tests_are_listed() {
    let named = named_tests();
    let mut unlisted = Vec::new();
    for file in files(&root().join("tests/suite"), &["rs"]) {
        let module = file.file_stem().expect("a name").to_string_lossy().into_owned();
        let tests = tests_of(&file).into_iter().map(|test| format!("{module}::{test}"));
        // Pages, not processes.
        unlisted.extend(tests.filter(|test| !test.starts_with("documentation::") && !named.contains(test)));
    }
    assert!(unlisted.is_empty(), "{PAGE} does not list these process tests: {unlisted:#?}");
}

/// The tests that only run every night, those that the page lists as such, and the tests of the same kind that are not long.
#[test]
fn long_tests_are_listed() {
    let mut long = BTreeSet::new();
    let folders = ["shared", "services", "tools", "tests", "lab", "examples"];
    for file in folders.iter().flat_map(|folder| files(&root().join(folder), &["rs"])) {
        let text = std::fs::read_to_string(&file).expect("text");
        for (index, _) in text.match_indices(concat!("#[ignore = ", "\"long: ")) {
            let (_, signature) = text[index..].split_once("fn ").expect("a function");
            long.extend(signature.split('(').next().map(str::to_owned));
        }
    }
    let page = std::fs::read_to_string(root().join(PAGE)).expect("the page exists");
    let (_, section) = page.split_once("\n## Long tests\n").expect("a section");
    let rows: Vec<Vec<&str>> =
        section.lines().filter(|line| line.starts_with("| `")).map(|line| line.split('|').collect()).collect();
    let functions = |column: usize| -> BTreeSet<String> {
        let spans = rows.iter().flat_map(|row| row[column].split('`').skip(1).step_by(2));
        spans.filter_map(|span| span.rsplit_once("::")).map(|(_, function)| function.to_owned()).collect()
    };
    assert!(!long.is_empty());
    assert_eq!(functions(1), long, "{PAGE} must list the long tests");
    let frequent = functions(2);
    assert!(frequent.is_disjoint(&long), "{PAGE} lists long tests as tests of every change");
}
