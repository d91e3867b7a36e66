//! `replica view` as a process: the served page and the kept files.

use crate::deliver::{names, run_with_doubts};
use crate::support::{printed, replica, succeeded, text};
use serde_json::{Value, json};
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

const FILES: [&str; 8] = [
    "index.html",
    "laz-perf.wasm",
    "licenses.txt",
    "points.copc.laz",
    "scene.json",
    "style.css",
    "viewer.js",
    "worker.js",
];

/// A serving process. Killed when dropped.
struct Viewer {
    child: Child,
    /// Host and port.
    address: String,
}

impl Viewer {
    fn start(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_replica"))
            .arg("view")
            .args(arguments)
            .args(["--port", "0"])
            .stdout(Stdio::piped())
            .spawn()
            .expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("is piped")).read_line(&mut line).expect("reads");
        let address = line.trim_start_matches("http://").split('/').next().expect("an address").to_owned();
        Self { child, address }
    }

    /// Head and body of a response.
    fn get(&self, name: &str, headers: &str) -> (String, Vec<u8>) {
        let mut stream = TcpStream::connect(&self.address).expect("connects");
        let request = format!("GET /{name} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n{headers}\r\n", self.address);
        stream.write_all(request.as_bytes()).expect("sends");
        let mut response = Vec::new();
        stream.read_to_end(&mut response).expect("reads");
        let end = response.windows(4).position(|four| four == b"\r\n\r\n").expect("a head") + 4;
        (String::from_utf8_lossy(&response[..end]).into_owned(), response[end..].to_vec())
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn modified(path: &Path) -> std::time::SystemTime {
    fs::metadata(path).expect("exists").modified().expect("is known")
}

#[test]
fn page_and_points_of_a_run_are_served() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, written) = run_with_doubts(folder.path(), &json!([]));
    let viewer = Viewer::start(&[text(&run)]);
    assert!(viewer.address.starts_with("127.0.0.1:"), "{}", viewer.address);
    let (head, page) = viewer.get("", "");
    assert!(head.starts_with("HTTP/1.1 200 ") && head.contains("text/html"), "{head}");
    assert!(String::from_utf8_lossy(&page).contains("viewer.js"));
    let scene: Value = serde_json::from_slice(&viewer.get("scene.json", "").1).expect("JSON");
    assert!(scene["coordinates"].as_str().is_some_and(|text| text.contains("UTM")), "{}", scene["coordinates"]);
    let cloud = fs::read(run.join("view/points.copc.laz")).expect("was written");
    let (head, part) = viewer.get("points.copc.laz", "Range: bytes=100-299\r\n");
    assert!(head.starts_with("HTTP/1.1 206 ") && head.contains(&format!("/{}\r\n", cloud.len())), "{head}");
    assert_eq!(part, cloud[100..300]);
    let n_points = u64::from_le_bytes(cloud[247..255].try_into().expect("8 bytes"));
    assert_eq!(n_points, written.n_points);
    assert!(viewer.get("../summary.json", "").0.starts_with("HTTP/1.1 404 "));

    // The boxes enclose the points, in their coordinates, and the path runs through them.
    let double = |at: usize| f64::from_le_bytes(cloud[at..at + 8].try_into().expect("8 bytes"));
    let [max_x, min_x, max_y, min_y] = [179, 187, 195, 203].map(double);
    let is_inside = |p: &Value| {
        let [x, y] = [0, 1].map(|axis| p[axis].as_f64().expect("a number"));
        (min_x..=max_x).contains(&x) && (min_y..=max_y).contains(&y)
    };
    let objects = scene["objects"].as_array().expect("a list");
    assert!(!objects.is_empty());
    for object in objects {
        let corners = object["corners"].as_array().expect("a list");
        assert!(corners.len() == 8 && corners.iter().any(is_inside), "{object}");
    }
    let path = scene["path"].as_array().expect("a list");
    assert!(!path.is_empty() && path.iter().all(is_inside), "{path:?}");
}

#[test]
fn octree_of_a_run_is_made_once_and_again_when_its_clouds_change() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, _) = run_with_doubts(folder.path(), &json!([]));
    let cloud = run.join("view/points.copc.laz");
    drop(Viewer::start(&[text(&run)]));
    let first = fs::read(&cloud).expect("was written");
    let time = modified(&cloud);
    drop(Viewer::start(&[text(&run)]));
    assert_eq!(modified(&cloud), time, "nothing has changed");
    // A cloud that is written again.
    let submap = run.join("clouds/submap_0000.ply");
    let bytes = fs::read(&submap).expect("reads");
    fs::remove_file(&submap).expect("removes");
    fs::write(&submap, bytes).expect("writes");
    drop(Viewer::start(&[text(&run)]));
    assert_ne!(modified(&cloud), time, "made again");
    assert_eq!(fs::read(&cloud).expect("was written"), first, "the same points give the same bytes");
}

#[test]
fn static_folder_has_all_that_is_served() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, _) = run_with_doubts(folder.path(), &json!([]));
    let out = folder.path().join("site");
    succeeded(&replica(&["view", text(&run), "--out", text(&out)]));
    assert_eq!(names(&out), FILES);
    let file = run.join("view/points.copc.laz");
    let viewer = Viewer::start(&[text(&file)]);
    for name in FILES {
        let (head, body) = viewer.get(name, "");
        assert!(head.starts_with("HTTP/1.1 200 "), "{name}: {head}");
        // A file has no path and no objects.
        assert_eq!(body == fs::read(out.join(name)).expect("was written"), name != "scene.json", "{name}");
    }
    let again = replica(&["view", text(&run), "--out", text(&out)]);
    assert_eq!(again.status.code(), Some(2), "{}", printed(&again));
    assert!(printed(&again).contains("the folder must be empty"), "{}", printed(&again));
}

#[test]
fn what_cannot_be_viewed_is_refused_with_the_rule() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("cloud.laz");
    fs::write(&file, [b"LASF".to_vec(), vec![0; 600]].concat()).expect("writes");
    for (path, rule) in [
        (file.as_path(), "not a COPC file"),
        (folder.path(), "is not a run, it has no summary.json"),
        (&folder.path().join("absent"), "absent: No such file"),
    ] {
        let output = replica(&["view", text(path), "--port", "0"]);
        assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
        assert!(printed(&output).contains(rule), "{rule}: {}", printed(&output));
    }
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("binds");
    let port = taken.local_addr().expect("has one").port().to_string();
    let output = replica(&["view", text(&file), "--port", &port]);
    assert!(printed(&output).contains(&format!("cannot listen on 127.0.0.1:{port}")), "{}", printed(&output));
    assert!(printed(&output).contains("hint: --port 0"), "{}", printed(&output));
}
