//! Steps of the stage on the test bench.

use crate::support::{MOVING_INSTANCE, Street, context, files, received};
use delivery::Index;
use export::{Coordinates, Export, Settings, TrajectoryFormat};
use formats::ply::Vertices;
use messages::{
    ClassHeader, ClassRow, ClassTopic, ColorTopic, InstanceTopic, SpectraTopic, SubmapTopic, TrajectoryTopic,
};
use stage::testing::Bench;
use stage::{Context, Mode, StepError, Word};
use std::path::Path;

const OPTIONAL: [&str; 4] = ["color", "spectra", "class", "instance"];

fn bench(context: &Context) -> Bench<Export> {
    Bench::new(&Settings::default(), context).expect("starts")
}

/// Sends each submap in one tick and its columns in the next, in the order of the pipeline.
fn run(bench: &mut Bench<Export>, street: &Street, seqs: std::ops::Range<u64>) {
    for seq in seqs {
        street.send_submap(bench, seq);
        bench.tick().expect("steps");
        street.send_columns(bench, seq, &OPTIONAL);
        bench.tick().expect("steps");
    }
}

fn whole_run(folder: &Path, street: &Street, n: u64) {
    let mut bench = bench(&context(folder));
    run(&mut bench, street, 0..n);
    bench.finish().expect("finishes");
}

fn index(folder: &Path) -> Index {
    serde_json::from_slice(&std::fs::read(folder.join("clouds/index.json")).expect("is there")).expect("is an index")
}

#[test]
fn cloud_contains_every_field_of_every_point() {
    let folder = tempfile::tempdir().expect("a folder");
    let street = Street::new(1, 5000);
    whole_run(folder.path(), &street, 2);
    let cloud = Vertices::load(&folder.path().join("clouds/submap_0001.ply")).expect("reads");
    let names: Vec<&str> = cloud.properties().iter().map(|property| property.name.as_str()).collect();
    let profile = "x y z x_lidar_position y_lidar_position z_lidar_position cos_angle_lidar_surface timestamp \
        index_frame intensity ring azimuth_deg elevation_deg dynamic instance semantic score red green blue camera";
    assert_eq!(names.join(" "), profile);
    let column = |name: &str| cloud.f64s(name).expect(name);
    let points = street.points(1);
    assert_eq!(cloud.len(), points.len());
    let xs = column("x");
    let ys = column("y");
    let zs = column("z");
    let lx = column("x_lidar_position");
    let ly = column("y_lidar_position");
    let lz = column("z_lidar_position");
    for (i, point) in points.iter().enumerate() {
        let expected = street.in_odom(1, [point.x, point.y, point.z].map(f64::from));
        let got = [xs[i], ys[i], zs[i]];
        assert!((0..3).all(|k| (got[k] - expected[k]).abs() < 1e-4), "point {i}: {got:?} should be {expected:?}");
        let lidar = street.lidar(1, point);
        let got = [lx[i], ly[i], lz[i]];
        assert!((0..3).all(|k| (got[k] - lidar[k]).abs() < 1e-4), "point {i}: {got:?} should be {lidar:?}");
    }
    let times = column("timestamp");
    let cosines = column("cos_angle_lidar_surface");
    for (i, point) in points.iter().enumerate() {
        let nanos = street.sweep_stamp(1, point.sweep_idx) + i64::from(point.offset_nanos);
        assert!((times[i] - nanos as f64 * 1e-9).abs() < 1e-6);
        let cosine = if point.incidence == 255 { -1.0 } else { f64::from(point.incidence) / 254.0 };
        assert!((cosines[i] - cosine).abs() < 1e-6);
    }
    let all = |name: &str, truth: &dyn Fn(usize) -> f64| {
        let got = column(name);
        assert!((0..points.len()).all(|i| (got[i] - truth(i)).abs() < 1e-4), "{name}");
    };
    all("index_frame", &|i| (street.first_sweep(1) + u64::from(points[i].sweep_idx)) as f64);
    all("intensity", &|i| f64::from(points[i].intensity));
    all("ring", &|i| f64::from(points[i].ring));
    all("azimuth_deg", &|i| f64::from(points[i].azimuth) / 100.0);
    all("elevation_deg", &|i| f64::from(points[i].elevation) / 100.0);
    let instances = street.instance(1);
    assert!(instances.contains(&MOVING_INSTANCE) && points.iter().any(|point| point.flags != 0));
    all("dynamic", &|i| f64::from(u8::from(points[i].flags != 0 || instances[i] == MOVING_INSTANCE)));
    all("instance", &|i| f64::from(street.instance(1)[i]));
    all("semantic", &|i| f64::from(street.class(1)[i].class_id));
    all("score", &|i| f64::from(street.class(1)[i].score) / 255.0);
    all("red", &|i| f64::from(street.color(1)[i].r));
    all("green", &|i| f64::from(street.color(1)[i].g));
    all("blue", &|i| f64::from(street.color(1)[i].b));
    all("camera", &|i| f64::from(street.color(1)[i].camera));
}

#[test]
fn spectra_have_a_cloud_of_their_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let street = Street::new(2, 300);
    whole_run(folder.path(), &street, 1);
    let cloud = Vertices::load(&folder.path().join("clouds/submap_0000.ply")).expect("reads");
    let spectra = Vertices::load(&folder.path().join("clouds/submap_0000_spectra.ply")).expect("reads");
    let (n_spectra, truth) = street.spectra(0);
    assert_eq!(spectra.len(), n_spectra);
    assert!(spectra.len() > 50 && spectra.len() < 250);
    let rows = spectra.i64s("point_idx").expect("is there");
    let all_x = cloud.f32s("x").expect("is there");
    let xs: Vec<f32> = rows.iter().map(|row| all_x[*row as usize]).collect();
    assert_eq!(spectra.f32s("x").expect("is there"), xs);
    for (band, name) in ["band_0500nm", "band_0612nm", "band_0612nm_b02"].into_iter().enumerate() {
        let got: Vec<u32> = spectra.f32s(name).expect(name).into_iter().map(f32::to_bits).collect();
        let expected: Vec<u32> = rows.iter().map(|row| truth(*row as usize, band).to_bits()).collect();
        assert_eq!(got, expected, "{name}");
    }
    assert_eq!(index(folder.path()).clouds[0].spectra.as_ref().map(|s| s.n_spectra), Some(n_spectra as u64));
}

#[test]
fn columns_that_come_late_change_nothing_but_when_the_cloud_is_written() {
    let street = Street::new(3, 2000);
    let on_time = tempfile::tempdir().expect("a folder");
    whole_run(on_time.path(), &street, 3);
    let late = tempfile::tempdir().expect("a folder");
    let mut bench = bench(&context(late.path()));
    let first = late.path().join("clouds/submap_0000.ply");
    street.send_submap(&mut bench, 0);
    street.send_columns(&mut bench, 0, &["color"]);
    bench.tick().expect("steps");
    street.send_submap(&mut bench, 1);
    street.send_columns(&mut bench, 0, &["class", "spectra"]);
    bench.tick().expect("steps");
    assert!(!first.exists(), "written before its instances were there");
    street.send_columns(&mut bench, 0, &["instance"]);
    street.send_columns(&mut bench, 1, &["color", "class"]);
    bench.tick().expect("steps");
    assert!(first.exists());
    street.send_columns(&mut bench, 1, &["spectra", "instance"]);
    street.send_submap(&mut bench, 2);
    street.send_columns(&mut bench, 2, &OPTIONAL);
    bench.tick().expect("steps");
    bench.finish().expect("finishes");
    assert_eq!(files(late.path()), files(on_time.path()));
    assert_eq!(files(late.path()).len(), 8, "two clouds for each of three submaps, index and trajectory");
}

#[test]
fn a_restart_in_mid_stream_leaves_the_same_bytes() {
    let street = Street::new(4, 2000);
    let undisturbed = tempfile::tempdir().expect("a folder");
    whole_run(undisturbed.path(), &street, 4);
    let folder = tempfile::tempdir().expect("a folder");
    let context = context(folder.path());
    let mut bench = bench(&context);
    run(&mut bench, &street, 0..2);
    street.send_submap(&mut bench, 2);
    street.send_columns(&mut bench, 2, &["color", "spectra"]);
    bench.tick().expect("steps");
    // Files that a run that continued after the barrier, and died, would have left.
    for name in ["submap_0002.ply", ".submap_0003.ply.partial", "index.json"] {
        std::fs::write(folder.path().join("clouds").join(name), "newer than the state").expect("writes");
    }
    let mut bench = bench.restarted(&Settings::default(), &context).expect("restarts");
    assert!(!folder.path().join("clouds/submap_0002.ply").exists());
    street.send_columns(&mut bench, 2, &["class", "instance"]);
    bench.tick().expect("steps");
    run(&mut bench, &street, 3..4);
    bench.finish().expect("finishes");
    assert_eq!(files(folder.path()), files(undisturbed.path()));
}

#[test]
fn state_with_changed_clouds_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = context(folder.path());
    let mut bench = bench(&context);
    run(&mut bench, &Street::new(4, 100), 0..1);
    std::fs::write(folder.path().join("clouds/submap_0000.ply"), "cut").expect("writes");
    let error = bench.restarted(&Settings::default(), &context).err().expect("is refused").to_string();
    assert!(error.contains("submap_0000.ply: 3 bytes, the saved state says"), "{error}");
}

#[test]
fn files_do_not_depend_on_the_number_of_threads() {
    let street = Street::new(5, 30_000);
    let runs = [1, 4].map(|threads| {
        let folder = tempfile::tempdir().expect("a folder");
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(|| whole_run(folder.path(), &street, 2));
        files(folder.path())
    });
    assert_eq!(runs[0], runs[1]);
}

#[test]
fn unpublished_columns_are_not_expected_and_have_no_field() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut context = context(folder.path());
    context.connected.retain(|topic| topic != "class" && topic != "spectra" && topic != "instance");
    let street = Street::new(6, 100);
    let mut bench = bench(&context);
    street.send_submap(&mut bench, 0);
    street.send_columns(&mut bench, 0, &["color"]);
    bench.tick().expect("steps");
    bench.finish().expect("finishes");
    let cloud = Vertices::load(&folder.path().join("clouds/submap_0000.ply")).expect("reads");
    assert!(cloud.has("red") && !cloud.has("semantic") && !cloud.has("score") && !cloud.has("instance"));
    assert!(!folder.path().join("clouds/submap_0000_spectra.ply").exists());
    let entry = index(folder.path()).clouds.remove(0);
    assert_eq!((entry.classes, entry.n_instances, entry.spectra), (None, None, None));
    assert_eq!(entry.n_colored, Some(street.color(0).iter().filter(|row| row.camera != 255).count() as u64));
    assert_eq!(bench.notes().len(), 3);
    assert!(bench.notes()[0].contains("topic spectra has no publisher"));
}

#[test]
fn materials_and_regions_are_written_behind_the_other_columns_if_they_are_published() {
    let street = Street::new(8, 500);
    let files_of = |connects: bool| {
        let folder = tempfile::tempdir().expect("a folder");
        let mut context = context(folder.path());
        context.connected.extend(["material", "region"].iter().filter(|_| connects).map(|topic| (*topic).to_owned()));
        let mut bench = bench(&context);
        street.send_submap(&mut bench, 0);
        street.send_columns(&mut bench, 0, &OPTIONAL);
        bench.tick().expect("steps");
        if connects {
            assert_eq!(bench.counter("clouds"), 0, "the cloud waits for its materials");
            street.send_columns(&mut bench, 0, &["material", "region"]);
            bench.tick().expect("steps");
        }
        bench.finish().expect("finishes");
        folder
    };
    let folder = files_of(true);
    let cloud = Vertices::load(&folder.path().join("clouds/submap_0000.ply")).expect("reads");
    let materials = street.material(0);
    let last: Vec<&str> = cloud.properties().iter().rev().take(3).map(|property| property.name.as_str()).collect();
    assert_eq!(last, ["region", "material_score", "material"]);
    let regions: Vec<i64> = street.regions(0).into_iter().map(i64::from).collect();
    assert_eq!(cloud.i64s("region").expect("is there"), regions);
    let ids: Vec<u8> = materials.iter().map(|row| row.material_id).collect();
    assert_eq!(cloud.u8s("material").expect("is there"), ids);
    let scores = cloud.f32s("material_score").expect("is there");
    assert_eq!(scores.len(), materials.len());
    assert!(scores.iter().zip(&materials).all(|(score, row)| (score - f32::from(row.score) / 255.0).abs() < 1e-6));
    let without = Vertices::load(&files_of(false).path().join("clouds/submap_0000.ply")).expect("reads");
    for word in ["material", "region"] {
        let columns = without.properties().iter().filter(|property| property.name.starts_with(word));
        assert_eq!((columns.count(), without.infos().iter().filter(|info| info.contains(word)).count()), (0, 0));
    }
}

#[test]
fn classes_of_a_further_segmenter_are_columns_behind_the_others_across_a_restart() {
    let street = Street::new(8, 500);
    let folder = tempfile::tempdir().expect("a folder");
    let settings = Settings { further_classes: vec!["class_b".to_owned()], ..Settings::default() };
    let context = context(folder.path());
    let mut bench = Bench::<Export>::new(&settings, &context).expect("starts");
    let classes: Vec<ClassRow> =
        street.class(0).iter().map(|row| ClassRow { class_id: 22 - row.class_id, score: 255 - row.score }).collect();
    street.send_submap(&mut bench, 0);
    street.send_columns(&mut bench, 0, &OPTIONAL);
    bench.tick().expect("steps");
    assert_eq!(bench.counter("clouds"), 0, "the cloud waits for the further classes");
    let mut bench = bench.restarted(&settings, &context).expect("restarts");
    bench.send_named::<ClassTopic>("class_b", 0, ClassHeader::default(), classes.clone());
    bench.tick().expect("steps");
    bench.finish().expect("finishes");
    let cloud = Vertices::load(&folder.path().join("clouds/submap_0000.ply")).expect("reads");
    let last: Vec<&str> = cloud.properties().iter().rev().take(2).map(|property| property.name.as_str()).collect();
    assert_eq!(last, ["class_b_score", "class_b"]);
    let ids = |rows: &[ClassRow]| rows.iter().map(|row| row.class_id).collect::<Vec<u8>>();
    assert_eq!(cloud.u8s("class_b").expect("is there"), ids(&classes));
    assert_eq!(cloud.u8s("semantic").expect("is there"), ids(&street.class(0)));
    let scores = cloud.f32s("class_b_score").expect("is there");
    assert_eq!(scores.len(), classes.len());
    assert!(scores.iter().zip(&classes).all(|(score, row)| (score - f32::from(row.score) / 255.0).abs() < 1e-6));
}

#[test]
fn further_classes_need_names_of_their_own() {
    for text in ["['class']", "['color']", "['class_']", "['class_b', 'class_b']"] {
        let text = format!("further_classes = {text}");
        let table = stage::toml::de::DeTable::parse(&text).expect("TOML");
        let (_, problems) = stage::parse_table::<Settings>(table.get_ref());
        assert_eq!(problems.len(), 1, "{text}");
        assert!(problems[0].text.contains("unique names that start with class_"), "{}", problems[0].text);
    }
}

#[test]
fn index_describes_the_clouds() {
    let folder = tempfile::tempdir().expect("a folder");
    let street = Street::new(7, 3000);
    whole_run(folder.path(), &street, 2);
    let index = index(folder.path());
    assert_eq!((index.clouds.len(), index.n_points), (2, 6000));
    for entry in &index.clouds {
        let path = folder.path().join(&entry.file);
        assert_eq!(std::fs::metadata(&path).expect("is there").len(), entry.bytes);
        let cloud = Vertices::load(&path).expect("reads");
        assert_eq!(cloud.len() as u64, entry.n_points);
        let [min, max] = entry.bounds.expect("has points");
        for (k, name) in ["x", "y", "z"].into_iter().enumerate() {
            let column = cloud.f64s(name).expect("is there");
            assert!((column.iter().copied().fold(f64::INFINITY, f64::min) - min[k]).abs() < 1e-4);
            assert!((column.iter().copied().fold(f64::NEG_INFINITY, f64::max) - max[k]).abs() < 1e-4);
        }
        let semantic = cloud.u8s("semantic").expect("is there");
        for (name, n) in entry.classes.as_ref().expect("has classes") {
            let id = messages::ClassId::from_name(name).expect("a known class") as u8;
            let got = semantic.iter().map(|class| u64::from(*class == id)).sum::<u64>();
            assert_eq!(got, *n, "{name}");
        }
        let mut ids = cloud.i64s("instance").expect("is there");
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.iter().filter(|id| **id != 0).count() as u64, entry.n_instances.expect("has instances"));
    }
}

#[test]
fn poses_are_written_to_the_trajectory_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let all = Settings { trajectory: TrajectoryFormat::ALL.to_vec(), ..Settings::default() };
    let mut bench = Bench::<Export>::new(&all, &context(folder.path())).expect("starts");
    let street = Street::new(8, 100);
    run(&mut bench, &street, 0..3);
    bench.finish().expect("finishes");
    let text = std::fs::read_to_string(folder.path().join("trajectory.txt")).expect("is there");
    let trajectory = formats::trajectory::trajectory_from_tum(&text).expect("parses");
    let truth: Vec<_> = (0..3).flat_map(|seq| street.poses(seq)).collect();
    assert_eq!(trajectory.poses().len(), truth.len());
    for ((stamp, pose), row) in trajectory.poses().iter().zip(&truth) {
        assert_eq!(stamp.0, row.stamp);
        let expected = row.odom_from_body.to_pose().expect("a pose");
        assert_eq!(pose.translation, expected.translation);
        assert!(pose.rotation.angle_to(&expected.rotation) < 1e-12);
    }
    let kitti = std::fs::read_to_string(folder.path().join("trajectory_kitti.txt")).expect("is there");
    assert_eq!(formats::trajectory::poses_from_kitti(&kitti).expect("parses").len(), truth.len());
    let csv = std::fs::read_to_string(folder.path().join("trajectory.csv")).expect("is there");
    assert_eq!(formats::trajectory::trajectory_from_csv(&csv), Ok(trajectory));
}

#[test]
fn submap_without_points_gives_an_empty_cloud() {
    let folder = tempfile::tempdir().expect("a folder");
    whole_run(folder.path(), &Street::new(9, 0), 1);
    let cloud = Vertices::load(&folder.path().join("clouds/submap_0000.ply")).expect("reads");
    assert_eq!(cloud.len(), 0);
    assert_eq!(index(folder.path()).clouds[0].bounds, None);
}

#[test]
fn double_coordinates_are_exact() {
    let folder = tempfile::tempdir().expect("a folder");
    let double = Settings { coordinates: Coordinates::Double, ..Settings::default() };
    let mut bench = Bench::<Export>::new(&double, &context(folder.path())).expect("starts");
    let street = Street::new(10, 100);
    run(&mut bench, &street, 0..1);
    let cloud = Vertices::load(&folder.path().join("clouds/submap_0000.ply")).expect("reads");
    let point = &street.points(0)[57];
    let expected = street.in_odom(0, [point.x, point.y, point.z].map(f64::from));
    assert!((cloud.f64s("x").expect("is there")[57] - expected[0]).abs() < 1e-12);
}

#[test]
fn files_of_earlier_run_are_removed_and_foreign_files_are_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let street = Street::new(11, 100);
    whole_run(folder.path(), &street, 3);
    std::fs::write(folder.path().join("clouds/notes.txt"), "mine").expect("writes");
    whole_run(folder.path(), &street, 1);
    let names: Vec<String> = files(folder.path()).into_iter().map(|(name, _)| name).collect();
    let expected =
        ["index.json", "notes.txt", "submap_0000.ply", "submap_0000_spectra.ply"].map(|n| format!("clouds/{n}"));
    assert_eq!(names, [&expected[..], &["trajectory.txt".to_owned()]].concat());
}

#[test]
fn contract_and_data_errors_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = context(folder.path());
    let street = Street::new(12, 100);
    let held = |n: u64| {
        let mut bench = bench(&context);
        for seq in 0..n {
            street.send_submap(&mut bench, seq);
            street.send_columns(&mut bench, seq, &["color", "spectra", "instance"]);
        }
        bench
    };
    let text = |result: Result<stage::Flow, StepError>| result.expect_err("is refused").to_string();
    held(2).tick().expect("two submaps may be held");
    let error = text(held(3).tick());
    assert_eq!(error, "submap 0 still waits for class, but 3 submaps wait, at most 2 may");
    let mut ended = held(1);
    ended.tick().expect("steps");
    let error = ended.finish().expect_err("is refused").to_string();
    assert_eq!(error, "submap 0 still waits for class, but the stream has ended");

    let mut short = held(1);
    short.send::<ClassTopic>(0, messages::ClassHeader::default(), street.class(0)[1..].to_vec());
    assert_eq!(text(short.tick()), "class column of submap 0 has 99 rows for 100 points");

    let mut early = bench(&context);
    street.forward_column(&mut early, "class", 1);
    assert_eq!(text(early.tick()), "class of submap 1 arrived, but submap 0 was due");

    let mut stray = bench(&context);
    let mut points = street.points(0);
    points[41].sweep_idx = 77;
    stray.send::<SubmapTopic>(0, street.header(0), points);
    street.send_columns(&mut stray, 0, &OPTIONAL);
    assert_eq!(text(stray.tick()), "submap 0: point 41 is of sweep 77; the header has 4");

    let mut bent = bench(&context);
    let mut pose = street.poses(0)[0];
    pose.odom_from_body.rotation[3] = 2.0;
    bent.send::<TrajectoryTopic>(0, messages::NoHeader::default(), vec![pose]);
    assert!(text(bent.tick()).contains("is not a rigid transform"));
}

/// 65 bands fit no validity bits and no list of wavelengths: the message must not be read past its end.
#[test]
fn spectra_of_more_bands_than_the_message_holds_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let street = Street::new(12, 100);
    let tick = |n_bands: usize| {
        let mut bench = bench(&context(folder.path()));
        street.send_submap(&mut bench, 0);
        street.send_columns(&mut bench, 0, &["color", "class", "instance"]);
        let (header, words) = street.spectra_message(0);
        let indices = &words[..header.n_points as usize];
        let table = vec![0; header.n_spectra as usize * (n_bands + 2)];
        let header = messages::SpectraHeader { n_bands: n_bands as u32, ..header };
        bench.forward::<SpectraTopic>(received(0, header, &[indices, &table].concat()));
        bench.tick()
    };
    tick(messages::MAX_BANDS).expect("the limit itself is valid");
    let error = tick(messages::MAX_BANDS + 1).expect_err("is refused").to_string();
    assert!(error.contains("spectra of submap 0") && error.contains("spectra of 65 bands for 100 points"), "{error}");
}

#[test]
fn column_lost_in_live_mode_is_omitted_and_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let context = Context { mode: Mode::Live, ..context(folder.path()) };
    let street = Street::new(13, 100);
    let mut bench = bench(&context);
    for seq in 0..2 {
        street.send_submap(&mut bench, seq);
        bench.forward::<ColorTopic>(received(seq, messages::ColorHeader::default(), &street.color(seq)));
        bench.forward::<InstanceTopic>(received(seq, messages::InstanceHeader::default(), &street.instance(seq)));
        let (header, words) = street.spectra_message(seq);
        bench.forward::<SpectraTopic>(received(seq, header, &words));
    }
    street.forward_column(&mut bench, "class", 1);
    bench.tick().expect("steps");
    bench.finish().expect("finishes");
    let clouds = index(folder.path()).clouds;
    assert_eq!(clouds[0].lost, ["class"]);
    assert_eq!((clouds[1].lost.len(), bench.counter("lost_columns")), (0, 1));
}

#[test]
fn unwritable_cloud_and_missing_folder_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let street = Street::new(14, 100);
    let mut blocked = bench(&context(folder.path()));
    blocked.tick().expect("steps");
    let partial = folder.path().join("clouds/.submap_0000.ply.partial");
    std::fs::create_dir(partial).expect("makes");
    street.send_submap(&mut blocked, 0);
    street.send_columns(&mut blocked, 0, &OPTIONAL);
    let error = blocked.tick().expect_err("a folder has the name of the cloud").to_string();
    assert!(error.contains("clouds/submap_0000.ply: cannot create: Is a directory"), "{error}");

    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("clouds"), "a file").expect("writes");
    let error = bench(&context(folder.path())).tick().expect_err("is not a folder").to_string();
    assert!(error.contains("clouds: cannot create"), "{error}");
}
