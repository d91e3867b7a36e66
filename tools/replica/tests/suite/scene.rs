//! `replica scene` on the results of a run.

use crate::deliver::run_with_doubts;
use crate::support::{printed, replica, text};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

fn json_file(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).expect("was written")).expect("JSON")
}

/// Every file below a folder with its bytes.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).expect("lists").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("below").to_owned();
                found.insert(name, std::fs::read(&path).expect("reads"));
            }
        }
    }
    found
}

#[test]
fn scene_has_ground_points_objects_and_the_same_bytes_for_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, written) = run_with_doubts(folder.path(), &json!([]));
    let out = folder.path().join("scene");
    let made = replica(&["scene", text(&run), "--out", text(&out), "--json"]);
    // A drive of 0.25 s is too short for a road, and the command says so.
    assert_eq!(made.status.code(), Some(3), "{}", printed(&made));
    let answer: Value = serde_json::from_slice(&made.stdout).expect("one object");
    assert_eq!(answer, json_file(&out.join("scene.json")));
    assert_eq!(answer["points"], written.n_points);
    let number = |value: &Value| value.as_f64().expect("a number");
    assert!(number(&answer["removed"]["movable"]) > 100.0 && number(&answer["measured_ground_m2"]) > 20.0, "{answer}");
    assert!(answer["left_out"].as_array().is_some_and(|lines| {
        lines.iter().any(|line| line.as_str().is_some_and(|line| line.starts_with("roads: ")))
    }));
    let objects = json_file(&out.join("objects.json"));
    assert_eq!(objects["movable"].as_array().map(Vec::len), answer["movable"].as_u64().map(|n| n as usize));
    let tileset = json_file(&out.join("tileset.json"));
    for child in tileset["root"]["children"].as_array().expect("meshes") {
        let mesh = std::fs::read(out.join(child["content"]["uri"].as_str().expect("a file"))).expect("is there");
        assert_eq!(&mesh[..4], b"glTF");
    }
    assert!(std::fs::read_to_string(out.join("roads.xodr")).expect("is there").contains("+lat_0="));

    let alone = folder.path().join("alone");
    let arguments = ["scene", text(&run), "--out", text(&alone)];
    let one_thread = Command::new(env!("CARGO_BIN_EXE_replica")).args(arguments).env("RAYON_NUM_THREADS", "1").output();
    assert_eq!(one_thread.expect("runs").status.code(), Some(3));
    let [first, second] = [files(&out), files(&alone)];
    assert_eq!(first.keys().collect::<Vec<_>>(), second.keys().collect::<Vec<_>>());
    assert!(first == second, "the bytes depend on the number of threads");
}

#[test]
fn run_that_cannot_become_a_scene_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, _) = run_with_doubts(folder.path(), &json!([]));
    let index = run.join("clouds/index.json");
    let mut without_classes = json_file(&index);
    without_classes["clouds"]
        .as_array_mut()
        .expect("clouds")
        .iter_mut()
        .for_each(|cloud| cloud["classes"] = Value::Null);
    std::fs::write(&index, without_classes.to_string()).expect("writes");
    let out = folder.path().join("scene");
    let refused = replica(&["scene", text(&run), "--out", text(&out)]);
    let said = printed(&refused);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(said.contains("the clouds have no classes") && said.contains("with the stage infer"), "{said}");
    assert!(!out.join("scene.json").exists());
    let absent = replica(&["scene", text(&folder.path().join("absent")), "--out", text(&out)]);
    assert_eq!(absent.status.code(), Some(1), "{}", printed(&absent));
}

#[test]
fn doubts_of_the_run_are_repeated() {
    let folder = tempfile::tempdir().expect("a folder");
    let text_of_doubt = "horizontal position of the submaps uncertain";
    let doubt = json!([{ "name": "position_uncertain", "size": 7.0, "text": text_of_doubt }]);
    let (run, _) = run_with_doubts(folder.path(), &doubt);
    let made = replica(&["scene", text(&run), "--out", text(&folder.path().join("scene"))]);
    assert!(printed(&made).contains("the run is doubtful: [export] horizontal position"), "{}", printed(&made));
}
