//! Several stages of one program in a run: each has its own settings and topics, and disturbs no other stage.

use formats::ply::Vertices;
use replica_tests::{
    Launch, OtherHost, Random, binary, drive, output_text, pipeline, reference, result_files, run_under_kills,
};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output};

/// A second segmenter in addition to `[infer]` of [`pipeline`], with the same model: points with a low score lose their
/// class.
const INFER_B: &str = "[infer_b]\nprogram = 'replica-infer'\nunknown_below = 0.9\nremap = { class = 'class_b' }\n";

/// The launch file continued; its last table is `[export]`.
fn with(launch: Launch, text: &str) -> Launch {
    let file = std::fs::OpenOptions::new().append(true).open(launch.folder().join("launch.toml"));
    file.and_then(|mut file| file.write_all(text.as_bytes())).expect("written");
    launch
}

fn infer_b(unknown_below: f64) -> String {
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("models/ground.safetensors");
    let keys = INFER_B.replace("0.9", &unknown_below.to_string());
    format!("{keys}model = '{}'\n", model.display())
}

/// Both segmenters, with their classes in the clouds.
fn two_segmenters() -> Launch {
    let further = format!("further_classes = ['class_b']\n{}", infer_b(0.9));
    with(pipeline(&drive(), "restarts = 1000", ""), &further)
}

fn succeeded(launch: &Launch) {
    let output = launch.run();
    assert_eq!(output.status.code(), Some(0), "{}", output_text(&output));
}

fn replica(arguments: &[&str]) -> (Option<i32>, String) {
    let Output { status, stdout, stderr } = Command::new(binary("replica")).args(arguments).output().expect("starts");
    (status.code(), format!("{}{}", String::from_utf8_lossy(&stdout), String::from_utf8_lossy(&stderr)))
}

fn assert_same(expected: &BTreeMap<String, Vec<u8>>, got: &BTreeMap<String, Vec<u8>>) {
    assert_eq!(expected.keys().collect::<Vec<_>>(), got.keys().collect::<Vec<_>>(), "other files");
    for (name, bytes) in expected {
        assert!(*bytes == got[name], "{name} differs");
    }
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

#[test]
fn second_segmenter_is_recorded_and_does_not_change_the_result() {
    let expected = reference("pipeline", || pipeline(&drive(), "", ""));
    let launch = with(pipeline(&drive(), "", ""), &infer_b(0.9));
    let recording = launch.folder().join("both.mcap");
    let launch = launch.with("--record").with(text(&recording)).with("--topics").with("submap,class,class_b");
    succeeded(&launch);
    assert_same(&expected, &result_files(&launch.output()));
    let summary = launch.stage_summary("infer_b");
    assert!(summary["outputs"]["class_b"]["messages"].as_u64() > Some(0), "{summary}");

    // The recording is replayed, with its topic `class_b` in place of its stage.
    let (code, said) = replica(&["inspect", text(&recording)]);
    assert!(code == Some(0) && said.contains("class_b"), "{said}");
    let replayed = launch.folder().join("replayed.mcap");
    let again = with(pipeline(&drive(), "", ""), &infer_b(0.9))
        .with("--source")
        .with("replay")
        .with("--set")
        .with(&format!("replay.recording={}", recording.display()))
        .with("--record")
        .with(text(&replayed))
        .with("--topics")
        .with("class_b");
    let output = again.run();
    assert!(output_text(&output).contains("left out"), "{}", output_text(&output));
    assert!(!output_text(&output).contains("[infer_b] "), "its topic is replayed: {}", output_text(&output));
    let (code, said) = replica(&["compare", text(&recording), text(&replayed), "--topics", "class_b"]);
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn classes_of_two_segmenters_are_columns_that_compare_tells_apart_after_kills() {
    let expected = reference("two_segmenters", two_segmenters);
    let launch = two_segmenters().with("--set").with("run.barrier_s=0.2");
    let kills = run_under_kills(&launch, &["infer", "infer_b"], 6, &mut Random::new(11));
    println!("{kills:?}");
    assert_same(&expected, &result_files(&launch.output()));

    let cloud = |folder: &Path| Vertices::load(&folder.join("clouds/submap_0000.ply")).expect("a cloud");
    let single = reference("pipeline", || pipeline(&drive(), "", ""));
    let single = Vertices::decode(single["submap_0000.ply"].clone(), Path::new("single.ply")).expect("a cloud");
    let cloud = cloud(&launch.output());
    for column in single.properties() {
        let name = column.name.as_str();
        assert!(single.f64s(name).ok() == cloud.f64s(name).ok(), "{name} is as in a run with one segmenter");
    }
    let (a, b) = (cloud.u8s("semantic").expect("a column"), cloud.u8s("class_b").expect("a column"));
    assert_eq!(a.len(), b.len());
    assert!(a != b && a.iter().zip(&b).all(|(a, b)| a == b || *b == 0), "points with a low score are unlabeled");

    let (code, said) = replica(&["compare", text(&launch.output())]);
    assert_eq!(code, Some(3), "{said}");
    for words in ["a: class of", "b: class_b of", "of the same class", "unlabeled", "ground"] {
        assert!(said.contains(words), "{words:?} is not in\n{said}");
    }
    let (code, said) = replica(&["compare", text(&launch.output()), text(&launch.output())]);
    assert_eq!((code, said.matches("(100.0 %)").count()), (Some(0), 2), "{said}");
    let (code, said) = replica(&["compare", text(&launch.output()), "--topics", "class,class_x"]);
    assert!(code == Some(1) && said.contains("no classes of topic class_x; it has class, class_b"), "{said}");
}

/// On the other host the stage uses its program's topic names, here the names of the run.
#[test]
fn second_segmenter_on_another_host_gives_the_same_clouds() {
    let expected = reference("two_segmenters", two_segmenters);
    let host = OtherHost::start();
    let launch = host.runs(two_segmenters(), "infer_b", "replica-infer", host.address());
    succeeded(&launch);
    assert_same(&expected, &result_files(&launch.output()));
}

#[test]
fn cameras_may_be_calibrated_by_a_stage_each() {
    let expected = reference("pipeline", || pipeline(&drive(), "", ""));
    let launch = with(
        pipeline(&drive(), "", "").with("--without").with("calibrate"),
        "[calibrate_hs02]\nprogram = 'replica-calibrate'\ncameras = ['hs02']\nremap = { cube = 'cube_hs02' }\n\
         [calibrate_hs03]\nprogram = 'replica-calibrate'\ncameras = ['hs03']\nremap = { cube = 'cube_hs03' }\n",
    )
    .with("--set")
    .with("colorize.remap={cube=['cube_hs02','cube_hs03']}");
    succeeded(&launch);
    assert_same(&expected, &result_files(&launch.output()));
}

#[test]
fn topics_without_a_name_of_their_own_are_refused() {
    let refused = |text: &str| {
        let output = with(pipeline(&drive(), "", ""), text).with("--check").run();
        assert_eq!(output.status.code(), Some(78), "{}", output_text(&output));
        output_text(&output)
    };
    let said = refused("[infer_b]\nprogram = 'replica-infer'\nmodel = 'x'\n");
    assert!(said.contains("topic class is already produced by [infer]; give this one another name"), "{said}");
    assert!(said.contains("remap = { class = \"class_b\" }"), "{said}");
    let said = refused(&infer_b(0.9).replace("{ class", "{ clas"));
    assert!(said.contains("infer_b.remap: the program has no topic clas; its topics are submap, class"), "{said}");
    let said = refused(&infer_b(0.9).replace("class = 'class_b'", "submap = 'submap_b', class = 'class_b'"));
    assert!(said.contains("[infer_b]") && said.contains("needs topic submap_b"), "{said}");
    let said = refused("further_classes = ['class_c']\n");
    assert!(said.contains("needs topic class_c, which no stage of this file produces"), "{said}");
}
