//! `replica deliver` on the results of a run.

use crate::finished_run::{FinishedRun, RunOptions, write_run};
use crate::support::{printed, replica, succeeded, text};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A run of two sweeps at the origin of its drive, with these doubts of export.
pub fn run_with_doubts(folder: &Path, doubts: &Value) -> (PathBuf, FinishedRun) {
    let drive = folder.join("drive");
    let run = folder.join("run");
    if !drive.exists() {
        let arguments = ["simulate", "--seed", "1", "--seconds", "0.25", "--rig", "survey", "--out", text(&drive)];
        succeeded(&replica(&arguments));
    }
    let written = write_run(&drive, &run, &RunOptions::default());
    let mut summary = serde_json::to_value(run::summary::Summary::default()).expect("encodes");
    let mut stage = serde_json::to_value(run::summary::StageSummary::default()).expect("encodes");
    stage["name"] = json!("export");
    stage["doubts"] = doubts.clone();
    summary["stages"] = json!([stage]);
    std::fs::write(run.join("summary.json"), summary.to_string()).expect("writes");
    (run, written)
}

#[test]
fn answer_as_json_has_the_facts_of_the_text() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, written) = run_with_doubts(folder.path(), &json!([]));
    let out = folder.path().join("out");
    let said = succeeded(&replica(&["deliver", text(&run), "--out", text(&out), "--semantic-kitti", "--json"]));
    let answer: Value = serde_json::from_str(&said).expect("one object and nothing else");
    assert_eq!((&answer["out"], &answer["epsg"]), (&json!(text(&out)), &json!(32_631)));
    assert_eq!(answer["n_points"], written.n_points);
    assert_eq!(answer["files"], facts(&out)["files"]);
    assert!(answer["path"].as_array().is_some_and(|files| files.contains(&json!("trajectory.csv"))), "{answer}");
    assert_eq!((&answer["rasters"], &answer["accuracy"]), (&json!([]), &Value::Null));
    assert_eq!(answer["semantic_kitti"]["n"], 3);
}

#[test]
fn killed_delivery_is_started_again_by_the_same_command() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, _) = run_with_doubts(folder.path(), &json!([]));
    let out = folder.path().join("delivery");
    let mut killed = Command::new(env!("CARGO_BIN_EXE_replica"));
    let mut killed = killed.args(["deliver", text(&run), "--out", text(&out)]).spawn().expect("starts");
    // Killed as soon as it writes; on a slow machine before, on a fast one after its end.
    while !out.join(".unfinished").exists() && killed.try_wait().expect("waits").is_none() {}
    killed.kill().and_then(|()| killed.wait()).expect("killed");
    let is_done = out.exists() && !out.join(".unfinished").exists();
    if !is_done {
        succeeded(&replica(&["deliver", text(&run), "--out", text(&out)]));
    }
    let undisturbed = folder.path().join("undisturbed");
    succeeded(&replica(&["deliver", text(&run), "--out", text(&undisturbed)]));
    assert_eq!(names(&out), names(&undisturbed));
}

fn facts(out: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(out.join("delivery.json")).expect("was written")).expect("JSON")
}

pub fn names(out: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(out).expect("lists");
    let mut names: Vec<String> =
        entries.map(|entry| entry.expect("lists").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn everything_is_written_in_utm_of_the_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, written) = run_with_doubts(folder.path(), &json!([]));
    let out = folder.path().join("out");
    let points = folder.path().join("points.csv");
    std::fs::write(&points, "name,x,y,z\nA,0,0,0\n").expect("writes");
    let delivered = replica(&[
        "deliver",
        text(&run),
        "--out",
        text(&out),
        "--copc",
        "--rasters",
        "--lines",
        "--cloudcompare",
        "--semantic-kitti",
        "--check-points",
        text(&points),
    ]);
    let said = printed(&delivered);
    assert_eq!(delivered.status.code(), Some(3), "{said}");
    assert!(said.contains("points.csv: none of 1 check points lies in the cloud"), "{said}");
    assert!(said.contains("check points outside of the cloud: A\n"), "{said}");
    assert!(said.contains("WGS 84 / UTM zone 31N (EPSG:32631), ellipsoidal height, m"), "{said}");
    let facts = facts(&out);
    assert_eq!((facts["epsg"].as_u64(), facts["n_points"].as_u64()), (Some(32_631), Some(written.n_points)));
    assert_eq!(facts["unreferenced"], Value::Null);
    let files = facts["files"].as_array().expect("a list");
    let in_tiles = files.iter().filter(|file| file["file"] != "points.copc.laz");
    assert_eq!(in_tiles.map(|file| file["n_points"].as_u64().expect("a count")).sum::<u64>(), written.n_points);
    let names = names(&out);
    for name in [
        "points.copc.laz",
        "trajectory.txt",
        "trajectory_kitti.txt",
        "trajectory.csv",
        "trajectory.geojson",
        "trajectory.sbet",
        "objects.csv",
        "objects.geojson",
        "terrain.tif",
        "height.tif",
        "color.tif",
        "class.tif",
        "class.tif.aux.xml",
        "density.tif",
        "terrain_source.tif",
        "orthophoto.tif",
        "orthophoto_source.tif",
        "contours.geojson",
        "breaklines.geojson",
        "markings.geojson",
        "tiles.geojson",
        "check_points.csv",
        "cloudcompare",
        "sequences",
    ] {
        assert!(names.iter().any(|found| found == name), "{name} is not in {names:?}");
    }
    assert!(names.iter().all(|name| !name.starts_with('.')), "nothing unfinished: {names:?}");

    let again = replica(&["deliver", text(&run), "--out", text(&out)]);
    assert_eq!(again.status.code(), Some(2));
    assert!(printed(&again).contains("the folder must be empty"), "{}", printed(&again));
}

#[test]
fn run_without_determined_place_is_refused_or_written_in_local_coordinates() {
    let folder = tempfile::tempdir().expect("a folder");
    let text_of_doubt = "heading undetermined: standard deviation 12.0 degrees (limit 5), median 11.0";
    let doubts = json!([
        { "name": "heading_undetermined", "size": 12.0, "text": text_of_doubt },
        { "name": "lost_columns", "size": 0.5, "text": "columns were lost" }
    ]);
    let (run, _) = run_with_doubts(folder.path(), &doubts);
    let out = folder.path().join("out");
    let deliver = |more: &[&str]| replica(&[&["deliver", text(&run), "--out", text(&out)][..], more].concat());
    for crs in ["auto", "EPSG:2154"] {
        let refused = deliver(&["--crs", crs]);
        assert_eq!(refused.status.code(), Some(1), "{}", printed(&refused));
        let said = printed(&refused);
        assert!(said.contains(text_of_doubt) && said.contains("hint: --allow-unreferenced"), "{said}");
        assert!(!said.contains("columns were lost") && !out.exists(), "{said}");
    }
    let said = succeeded(&deliver(&["--allow-unreferenced"]));
    assert!(said.contains("warning: coordinates are local"), "{said}");
    assert_eq!((&facts(&out)["epsg"], facts(&out)["unreferenced"].as_str()), (&Value::Null, Some(text_of_doubt)));
    assert!(!names(&out).iter().any(|name| name.contains("geojson") || name.contains("sbet")), "{:?}", names(&out));

    // Without a place, local coordinates may be asked for.
    let local = folder.path().join("local");
    succeeded(&replica(&["deliver", text(&run), "--out", text(&local), "--crs", "local", "--las", "--tile-m", "0"]));
    assert!(names(&local).contains(&"points.las".to_owned()));
    std::fs::remove_file(run.join("georeference.json")).expect("removed");
    let nowhere = replica(&["deliver", text(&run), "--out", text(&folder.path().join("nowhere"))]);
    assert!(printed(&nowhere).contains("is not placed on the Earth"), "{}", printed(&nowhere));
    std::fs::remove_file(run.join("summary.json")).expect("removed");
    let unfinished = replica(&["deliver", text(&run), "--out", text(&folder.path().join("unfinished"))]);
    assert!(printed(&unfinished).contains("the run is not finished"), "{}", printed(&unfinished));
}

/// A geoid of 50 m everywhere in latitudes 40 to 60 and longitudes 0 to 20.
fn write_geoid(path: &Path) {
    let doubles = [40.0, 0.0, 20.0, 20.0].into_iter().flat_map(f64::to_be_bytes);
    let sizes = [2_i32, 2].into_iter().flat_map(i32::to_be_bytes);
    let values = [50.0_f32; 4].into_iter().flat_map(f32::to_be_bytes);
    std::fs::write(path, doubles.chain(sizes).chain(values).collect::<Vec<u8>>()).expect("writes");
}

/// Position of the first pose of the path.
fn first_position(out: &Path) -> [f64; 3] {
    let poses = std::fs::read_to_string(out.join("trajectory.txt")).expect("was written");
    let pose = poses.lines().find(|line| !line.starts_with('#')).expect("has a pose");
    let values: Vec<f64> = pose.split(' ').map(|value| value.parse().expect("a number")).collect();
    [values[1], values[2], values[3]]
}

/// The federal system of Switzerland, and a height system. The origin is the old observatory of Bern, where LV95 has its own origin.
#[test]
fn run_is_delivered_in_national_systems_with_heights() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, _) = run_with_doubts(folder.path(), &json!([]));
    let geoid = folder.path().join("chgeo2004.gtx");
    write_geoid(&geoid);
    let deliver = |name: &str, crs: &str, more: &[&str]| {
        let out = folder.path().join(name);
        succeeded(&replica(&[&["deliver", text(&run), "--out", text(&out), "--crs", crs, "--las"][..], more].concat()));
        out
    };
    // The origin of LV95, 2 600 000 and 1 200 000, by pyproj 3.7.2: `Transformer.from_crs(4979, 2056)` gives it within 1 cm.
    place_at(&run, 46.951_082_86, 7.438_632_495);
    let local = deliver("local", "local", &[]);
    let plain = deliver("lv95", "EPSG:2056", &[]);
    let with_height = deliver("ln02", "EPSG:2056+5728", &["--geoid", text(&geoid)]);
    let [east, north, up] = first_position(&plain);
    let [x, y, _] = first_position(&local);
    let off = [east - 2_600_000.0 - x, north - 1_200_000.0 - y];
    assert!(off.iter().all(|off| off.abs() < 0.03), "{east} {north}, {x} {y}: {off:?}");
    let [same_east, same_north, down] = first_position(&with_height);
    assert!((same_east - east).abs() < 1e-6 && (same_north - north).abs() < 1e-6 && (up - down - 50.0).abs() < 1e-6);
    assert_eq!((&facts(&plain)["epsg"], &facts(&plain)["heights_epsg"]), (&json!(2056), &Value::Null));
    let facts = facts(&with_height);
    assert_eq!((&facts["heights"], &facts["heights_epsg"]), (&json!("LN02 height"), &json!(5728)));
    let mut files = std::fs::read_dir(&with_height).expect("lists").map(|entry| entry.expect("lists").path());
    let las = files.find(|path| path.extension().is_some_and(|end| end == "las")).expect("has a tile");
    let bytes = std::fs::read(las).expect("reads");
    let header = String::from_utf8_lossy(&bytes[..6000.min(bytes.len())]).into_owned();
    for part in [
        r#"PROJCS["CH1903+ / LV95""#,
        r#"AUTHORITY["EPSG","2056"]],VERT_CS["LN02 height""#,
        r#"AUTHORITY["EPSG","5728"]"#,
    ] {
        assert!(header.contains(part), "{part}");
    }
}

#[test]
fn wrong_arguments_are_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, _) = run_with_doubts(folder.path(), &json!([]));
    let out = folder.path().join("out");
    let grid = folder.path().join("grid.gtx");
    std::fs::write(&grid, "no grid").expect("writes");
    let egm96 = folder.path().join("egm96.gtx");
    write_geoid(&egm96);
    for (more, code, rule) in [
        (&["--crs", "EPSG:4326"][..], 2, "--crs: EPSG:4326 is not a projected system of the EPSG registry"),
        (&["--crs", "EPSG:2263"], 2, "its coordinates are in US survey foot, deliveries are in metres"),
        (&["--crs", "EPSG:27700"], 2, "needs a grid of its datum in the format NTv2: OSTN15_NTv2_OSGBtoETRS.gsb"),
        (&["--crs", "EPSG:27700", "--grid", text(&grid)], 1, "grid.gtx: is not an NTv2 grid (.gsb): 7 bytes"),
        (
            &["--crs", "EPSG:25832+7837"],
            2,
            "heights of EPSG:7837 (DHHN2016 height) need its geoid grid; PROJ has de_bkg_gcg2016.tif",
        ),
        (&["--crs", "EPSG:25832+25833"], 2, "EPSG:25833 is not a vertical system of the EPSG registry"),
        (
            &["--crs", "EPSG:25832+7837", "--geoid", text(&egm96)],
            2,
            "egm96.gtx has heights of EPSG:5773 (EGM96 height), --crs wants heights of EPSG:7837",
        ),
        (
            &["--crs", "EPSG:7415"],
            2,
            "EPSG:28992 (Amersfoort / RD New) needs a grid of its datum in the format NTv2: rdtrans2018.gsb",
        ),
        (&["--crs", "local", "--grid", text(&grid)], 2, "--grid: needs a coordinate reference system"),
        (&["--grid", text(&grid)], 2, "--grid: needs --crs EPSG:N"),
        (&["--crs", "utm"], 2, "must be auto, local, EPSG:N or EPSG:N+M"),
        (&["--crs", "local", "--geoid", text(&grid)], 2, "--geoid: needs a coordinate reference system"),
        (&["--geoid", text(&grid)], 1, "grid.gtx: is not a GTX grid: 7 bytes"),
        (&["--tile-m", "-1"], 2, "invalid value '-1' for '--tile-m <M>': must be a whole number, 0 to 100000"),
        (&["--tile-m", "NaN"], 2, "invalid value 'NaN' for '--tile-m <M>': must be a whole number, 0 to 100000"),
        (&["--rasters", "--cell-m", "-1"], 2, "invalid value '-1' for '--cell-m <M>': must be 0.01 to 100"),
        (&["--force-crs"], 2, "--force-crs: needs --crs EPSG:N"),
        (&["--tile-m", "0.5"], 2, "must be a whole number, 0 to 100000"),
        (&["--cell-m", "0.5"], 2, "--rasters"),
        (&["--rasters", "--cell-m", "0"], 2, "must be 0.01 to 100"),
        (&["--system", "a name of more than thirty-two letters"], 2, "must be up to 32 ASCII characters"),
    ] {
        let refused = replica(&[&["deliver", text(&run), "--out", text(&out)][..], more].concat());
        assert_eq!(refused.status.code(), Some(code), "{more:?}: {}", printed(&refused));
        assert!(printed(&refused).contains(rule), "{more:?}: {}", printed(&refused));
        assert!(!out.exists(), "{more:?}");
    }
}

/// Moves the origin of a run.
fn place_at(run: &Path, latitude_deg: f64, longitude_deg: f64) {
    let path = run.join("georeference.json");
    let mut georeference: Value = serde_json::from_slice(&std::fs::read(&path).expect("is there")).expect("JSON");
    georeference["origin"] =
        json!({ "latitude_deg": latitude_deg, "longitude_deg": longitude_deg, "altitude_m": 50.0 });
    std::fs::write(&path, georeference.to_string()).expect("writes");
}

#[test]
fn crs_is_refused_outside_of_its_area_unless_forced() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, _) = run_with_doubts(folder.path(), &json!([]));
    let out = folder.path().join("out");
    let deliver = |more: &[&str]| replica(&[&["deliver", text(&run), "--out", text(&out)][..], more].concat());
    let refused = deliver(&["--crs", "EPSG:32760"]);
    let said = printed(&refused);
    assert_eq!(refused.status.code(), Some(2), "{said}");
    for part in [
        "EPSG:32760 (WGS 84 / UTM zone 60S) is for latitude -80 to 0, longitude 174 to 180 degrees",
        "the drive is at latitude 48.846222 longitude 2.346414",
        "systems that fit: EPSG:32631 (WGS 84 / UTM zone 31N), EPSG:25831 (ETRS89 / UTM zone 31N), EPSG:",
        "hint: --crs EPSG:32631; --force-crs writes EPSG:32760 nevertheless",
    ] {
        assert!(said.contains(part), "{part}\nis not in\n{said}");
    }
    assert!(!out.exists());
    let said = succeeded(&deliver(&["--crs", "EPSG:32760", "--force-crs"]));
    assert!(said.contains("warning: EPSG:32760"), "{said}");
    assert!(facts(&out)["outside_area"].as_str().is_some_and(|text| text.contains("48.846222")), "{}", facts(&out));

    // (latitude, longitude, system, exit code, warning)
    for (k, (lat, lon, crs, code, warning)) in [
        (48.846_222, 2.346_414, "EPSG:2154", 0, false),
        (48.846_222, 2.346_414, "EPSG:3812", 2, false),
        (48.6, 13.4, "EPSG:25832", 0, true),
        (48.6, 14.2, "EPSG:25832", 2, false),
        (60.39, 5.32, "EPSG:32632", 0, false),
        (-16.8, -179.999, "EPSG:32760", 0, true),
        (-16.8, 179.99, "EPSG:32760", 0, false),
        (85.0, 10.0, "EPSG:32632", 2, false),
    ]
    .into_iter()
    .enumerate()
    {
        place_at(&run, lat, lon);
        let out = folder.path().join(format!("out{k}"));
        let delivered = replica(&["deliver", text(&run), "--out", text(&out), "--crs", crs]);
        let said = printed(&delivered);
        assert_eq!(delivered.status.code(), Some(code), "{lat} {lon} {crs}: {said}");
        assert_eq!(said.contains("warning: EPSG"), warning, "{lat} {lon} {crs}: {said}");
        if code == 0 {
            assert_eq!(facts(&out)["outside_area"], Value::Null, "{lat} {lon} {crs}");
        }
    }
}

#[test]
fn run_near_a_pole_is_delivered_in_local_coordinates_only() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, _) = run_with_doubts(folder.path(), &json!([]));
    place_at(&run, 85.0, 10.0);
    let out = folder.path().join("out");
    let refused = replica(&["deliver", text(&run), "--out", text(&out)]);
    let said = printed(&refused);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(said.contains("latitude 85 degrees is outside UTM; expected -80 to 84"), "{said}");
    assert!(said.contains("--crs local") && said.contains("hint: --crs EPSG:5041") && !out.exists(), "{said}");
    let forced = replica(&["deliver", text(&run), "--out", text(&out), "--crs", "EPSG:2154"]);
    let said = printed(&forced);
    assert!(said.contains("EPSG:5041 (WGS 84 / UPS North (E,N))"), "{said}");
    let polar = folder.path().join("polar");
    succeeded(&replica(&["deliver", text(&run), "--out", text(&polar), "--crs", "EPSG:5041"]));
    assert_eq!(facts(&polar)["epsg"], 5041);
    succeeded(&replica(&["deliver", text(&run), "--out", text(&out), "--crs", "local"]));
    assert!(facts(&out)["frame"].as_str().is_some_and(|frame| frame.contains("around 85 10 50")), "{}", facts(&out));
}

#[test]
fn folder_that_is_no_finished_run_is_named_with_the_next_step() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, _) = run_with_doubts(folder.path(), &json!([]));
    let drive = folder.path().join("drive");
    let missing = folder.path().join("missing");
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).expect("made");
    let delivery = folder.path().join("delivery");
    succeeded(&replica(&["deliver", text(&run), "--out", text(&delivery)]));
    let images = folder.path().join("images");
    std::fs::create_dir(&images).expect("made");
    std::fs::copy(run.join("summary.json"), images.join("summary.json")).expect("copied");
    let no_points = folder.path().join("no_points");
    std::fs::create_dir_all(no_points.join("clouds")).expect("made");
    for name in ["summary.json", "georeference.json", "trajectory.txt"] {
        std::fs::copy(run.join(name), no_points.join(name)).expect("copied");
    }
    std::fs::write(no_points.join("clouds/index.json"), delivery::Index::new(&[], "local").to_json()).expect("writes");
    let needs = "`deliver` needs the output folder of a finished run";
    for (path, parts) in [
        (
            &drive,
            &["drive: is a drive, it has drive.toml", needs, "hint: `replica-launch launch.toml --set run.drive="][..],
        ),
        (&missing, &["missing: no such folder", needs]),
        (&empty, &["empty: is not a run, it has no summary.json", needs]),
        (&run.join("summary.json"), &["summary.json: is a file", needs]),
        (&delivery, &["delivery: is a delivery, it has delivery.json", needs]),
        (
            &images,
            &["images: has no clouds/index.json: the run wrote no clouds", "hint: run the drive with the stages"],
        ),
        (
            &no_points,
            &["no_points: the run has 0 clouds with 0 points; `deliver` needs points", "hint: `replica inspect "],
        ),
    ] {
        let out = folder.path().join("out");
        let refused = replica(&["deliver", text(path), "--out", text(&out)]);
        let said = printed(&refused);
        assert_eq!(refused.status.code(), Some(1), "{said}");
        assert!(parts.iter().all(|part| said.contains(part)), "{parts:?}\n{said}");
        assert!(said.matches("os error").count() <= 1 && !out.exists(), "{said}");
    }
}

/// Opening a pipe without writer would wait forever.
#[test]
fn pipes_in_place_of_files_end_in_an_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let (run, _) = run_with_doubts(folder.path(), &json!([]));
    let kitti = folder.path().join("kitti");
    std::fs::create_dir_all(kitti.join("sequences/00/velodyne")).expect("made");
    std::fs::write(kitti.join("sequences/00/velodyne/000000.bin"), [0; 160]).expect("written");
    let bag = folder.path().join("bag");
    std::fs::create_dir(&bag).expect("made");
    let sequence = kitti.join("sequences/00");
    let out = folder.path().join("out");
    for (pipe, arguments) in [
        (sequence.join("times.txt"), vec!["import", text(&sequence), text(&out)]),
        (bag.join("metadata.yaml"), vec!["import", text(&bag), text(&out)]),
        (folder.path().join("points.csv"), vec!["deliver", text(&run), "--out", text(&out), "--check-points"]),
        (run.join("georeference.json"), vec!["deliver", text(&run), "--out", text(&out)]),
        (run.join("summary.json"), vec!["deliver", text(&run), "--out", text(&out)]),
    ] {
        let _ = std::fs::remove_file(&pipe);
        assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
        let mut command = Command::new("timeout");
        command.arg("60").arg(env!("CARGO_BIN_EXE_replica")).args(&arguments);
        if arguments.last() == Some(&"--check-points") {
            command.arg(&pipe);
        }
        let output = command.output().expect("timeout starts");
        let said = printed(&output);
        assert!(output.status.code().is_some_and(|code| code != 0 && code != 124), "{}: {said}", pipe.display());
    }
}
