//! The drive folder that the simulation writes.

use crate::support::{SHARED_DRIVE, SharedDrive, files, revolutions, udp_payloads};
use drive::Drive;
use drive::manifest::Manifest;
use formats::sensor_calibration::SensorCalibration;
use geometry::{CameraModel, KannalaBrandt, Point3};
use lidar::velodyne::Model;
use lidar::{SweepPoint, SweepReader};
use simulation::sensors::camera::ColorCamera;
use simulation::{DriveSpec, RigSpec, Simulation, SimulationError, write_drive};
use std::collections::BTreeMap;

fn drive(spec: &DriveSpec, threads: usize) -> BTreeMap<String, Vec<u8>> {
    let folder = tempfile::tempdir().expect("a folder");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let out = folder.path().join("drive");
    pool.install(|| write_drive(spec, &out, &mut |_| ())).expect("a drive");
    files(&out)
}

#[test]
fn drive_bytes_do_not_depend_on_thread_count() {
    let spec = DriveSpec { lidar_step: 8, cameras: false, truth_visibility: true, ..DriveSpec::urban(5, 0.4) };
    let one = drive(&spec, 1);
    let two = drive(&spec, 2);
    assert!(one.contains_key("drive.toml") && one.keys().any(|name| name.starts_with("hs02/")));
    assert!(one == two, "a file differs");
    // Images have a sixteenth of the size, which keeps the test short.
    let CameraModel::KannalaBrandt(lens) = RigSpec::l3d2().cameras[0].lens.clone() else { panic!("another lens") };
    let fx = lens.fx / 4.0;
    let fy = lens.fy / 4.0;
    let cx = lens.cx / 4.0;
    let cy = lens.cy / 4.0;
    let camera = ColorCamera::new(&CameraModel::KannalaBrandt(KannalaBrandt {
        width: 154,
        height: 128,
        fx,
        fy,
        cx,
        cy,
        ..lens
    }));
    let simulation = Simulation::new(&spec).expect("a town");
    let images = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| simulation.images(&camera, &[0, 1, 2, 3, 4, 5], simulation.exposures()[0]))
    };
    let one = images(1);
    let two = images(3);
    assert!(one == two, "an image differs");
    assert!(simulation.image(&camera, 2, simulation.exposures()[0]) == one[2], "an image does not depend on the group");
}

#[test]
fn different_seed_gives_different_drive() {
    let a = &SHARED_DRIVE.files;
    let b = drive(&DriveSpec::urban(5, 2.2).sparse(3), 2);
    for name in ["lidar/000000.pcap", "truth/labels/000000.label", "imu.csv", "gnss.nmea"] {
        assert!(a[name] != b[name], "{name} does not depend on the seed");
    }
}

#[test]
fn every_return_has_a_label_in_firing_order() {
    let files = &SHARED_DRIVE.files;
    let sweeps = revolutions(&files["lidar/000000.pcap"]);
    let labels: Vec<&Vec<u8>> =
        files.iter().filter(|(name, _)| name.starts_with("truth/labels/")).map(|(_, bytes)| bytes).collect();
    assert_eq!(sweeps.len(), labels.len());
    for (sweep, labels) in sweeps.iter().zip(&labels) {
        assert_eq!(labels.len(), sweep.len() * 4);
        for label in labels.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().expect("4 bytes"))) {
            let class = label & 0xffff;
            let instance = label >> 16;
            assert!(class <= 22);
            assert_eq!(instance > 0, class == 4 || class == 10, "only pedestrians and vehicles have instances");
        }
    }
    assert!(sweeps[..5].iter().all(|sweep| sweep.len() > 10_000));
}

#[test]
fn manifest_matches_drive_contents() {
    let files = drive(&DriveSpec { lidar_step: 30, ..DriveSpec::urban(3, 0.3) }, 2);
    let text = String::from_utf8(files["drive.toml"].clone()).expect("text");
    let manifest: Manifest = toml::from_str(&text).expect("a manifest");
    let rig = manifest.rig().expect("sound poses");
    assert_eq!((rig.cameras.len(), rig.mosaics.len()), (6, 2));
    for camera in &manifest.cameras {
        let name = files.keys().find(|name| name.starts_with(&format!("{}/", camera.folder))).expect("an image");
        let picture = image::load_from_memory(&files[name]).expect("a JPEG");
        assert_eq!((picture.width(), picture.height()), camera.model.size());
    }
    for mosaic in &manifest.mosaics {
        assert_eq!(mosaic.wavelengths_nm.len(), (mosaic.pattern * mosaic.pattern) as usize);
        let xml = std::str::from_utf8(&files[&format!("{}/sensor.xml", mosaic.folder)]).expect("text");
        let sensor = SensorCalibration::from_xml(xml).expect("the maker's format");
        assert_eq!((sensor.active_area, sensor.pattern), (mosaic.active_area, mosaic.pattern));
        for (band, nm) in sensor.bands.iter().zip(&mosaic.wavelengths_nm) {
            assert!((band.wavelength_nm() - nm).abs() < 0.05);
        }
        for kind in ["dark/0.pgm", "white/1.pgm", "1622541603250000000.pgm"] {
            let bytes = &files[&format!("{}/{kind}", mosaic.folder)];
            assert!(bytes.starts_with(b"P5\n2048 1088\n1023\n"));
            assert_eq!(bytes.len(), 18 + 2048 * 1088 * 2);
        }
    }
    let truth = String::from_utf8(files["truth/trajectory.txt"].clone()).expect("text");
    let trajectory = formats::trajectory::trajectory_from_tum(&truth).expect("poses");
    assert_eq!(trajectory.poses().len(), 32);
    assert!(text.contains("gnss.nmea") && files.contains_key("gnss.nmea") && files.contains_key("imu.csv"));
}

#[test]
fn position_packets_repeat_latest_gnss_sentence() {
    let files = &SHARED_DRIVE.files;
    let sentences: Vec<String> = udp_payloads(&files["lidar/000000.pcap"])
        .into_iter()
        .filter(|(port, _)| *port == 8308)
        .map(|(_, bytes)| {
            assert_eq!((bytes.len(), bytes[202]), (512, 2), "the clock follows the pulse");
            String::from_utf8_lossy(&bytes[206..]).trim_end_matches('\0').trim_end().to_owned()
        })
        .collect();
    // 200 a second, of three seconds.
    assert_eq!(sentences.len(), 3980_usize.div_ceil(9));
    let mut different = sentences.clone();
    different.dedup();
    assert_eq!(different.len(), 3);
    for (sentence, time) in different.iter().zip(["100004.000", "100005.000", "100006.000"]) {
        assert!(sentence.starts_with(&format!("$GPRMC,{time},A,48")), "{sentence}");
    }
}

#[test]
fn drive_is_never_overwritten_and_stale_partial_folder_is_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("drive");
    // An interrupted run leaves a partial folder, which the next run replaces.
    std::fs::create_dir_all(folder.path().join("drive.partial/lidar")).expect("a folder");
    std::fs::write(folder.path().join("drive.partial/lidar/stale.pcap"), b"old").expect("a file");
    let spec = DriveSpec::urban(1, 0.2).sparse(50);
    let mut shares = Vec::new();
    let report = write_drive(&spec, &out, &mut |share| shares.push(share)).expect("a drive");
    assert!(!folder.path().join("drive.partial").exists() && !out.join("lidar/stale.pcap").exists());
    assert!(shares.is_sorted() && (shares.last().expect("progress") - 1.0).abs() < 1e-9);
    assert_eq!(report.n_returns, report.returns_by_class.iter().sum::<u64>());
    let before = files(&out);
    assert!(matches!(write_drive(&spec, &out, &mut |_| ()), Err(SimulationError::Exists(_))));
    assert!(files(&out) == before);
}

#[test]
fn out_of_range_setting_is_named_in_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("drive");
    for (spec, name) in [
        (DriveSpec::urban(1, f64::NAN), "seconds"),
        (DriveSpec::urban(1, 1e9), "seconds"),
        (DriveSpec { lidar_step: 0, ..DriveSpec::urban(1, 1.0) }, "lidar_step"),
        (DriveSpec { mosaic_exposure_nanos: 5, ..DriveSpec::urban(1, 1.0) }, "mosaic_exposure_ms"),
    ] {
        let error = write_drive(&spec, &out, &mut |_| ()).expect_err("refused");
        assert!(error.to_string().contains(name), "{error}");
        assert!(!out.exists());
    }
}

#[test]
fn decoder_returns_equal_simulated_returns() {
    let SharedDrive { path, files, simulation } = &*SHARED_DRIVE;
    let by_manual = revolutions(&files["lidar/000000.pcap"]);
    let begin = simulation.motion.begin;
    let mut reader =
        SweepReader::open(vec![path.join("lidar/000000.pcap")], Some(&Model::Hdl32e.into())).expect("a capture");
    for (seq, expected) in by_manual.iter().enumerate() {
        let mut returns = Vec::new();
        let info = reader.next_sweep(|some| returns.extend_from_slice(some)).expect("sound").expect("a sweep");
        assert_eq!(files[&format!("truth/labels/{seq:06}.label")].len(), 4 * info.n_returns);
        assert_eq!((info.seq, info.lost_packets, returns.len()), (seq as u64, 0, expected.len()));
        for (found, expected) in returns.iter().zip(expected) {
            let [x, y, z] = expected.direction.map(|d| d * expected.range_m);
            let off = (f64::from(found.x) - x).hypot(f64::from(found.y) - y).hypot(f64::from(found.z) - z);
            // The decoder resolves angles to 0.01 degrees.
            assert!(off < 0.0005 + 2e-4 * expected.range_m, "{found:?} {expected:?}");
            assert_eq!(found.intensity, expected.intensity);
            let seconds = info.stamp.seconds_since(begin) + f64::from(found.offset_nanos) * 1e-9;
            assert!((seconds - expected.seconds).abs() < 2e-6, "{seconds} {}", expected.seconds);
        }
    }
    assert!(reader.next_sweep(|_| ()).expect("sound").is_none());
}

/// Heights in the body frame of returns within 8 m, sorted.
fn heights_around(drive: &Drive) -> Vec<f64> {
    let mut heights = Vec::new();
    let mut sweeps = drive.sweeps().expect("a recording");
    let mut look = |returns: &[SweepPoint]| {
        for found in returns {
            let p = drive.rig().body_from_lidar * Point3::new(found.x, found.y, found.z).cast::<f64>();
            if p.x.hypot(p.y) < 8.0 {
                heights.push(p.z);
            }
        }
    };
    while sweeps.next_sweep(&mut look).expect("sound").is_some() {}
    heights.sort_by(f64::total_cmp);
    heights
}

#[test]
#[ignore = "long: .ci/run --nightly"]
fn built_in_rigs_of_other_data_sets_produce_drives() {
    for (name, model, n_cameras) in [("nuscenes", Model::Hdl32e, 6), ("kitti", Model::Hdl64e, 2)] {
        let rig = RigSpec::built_in(name).expect("built in");
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("drive");
        let spec = DriveSpec { rig, lidar_step: 8, ..DriveSpec::urban(3, 0.3) };
        let report = write_drive(&spec, &out, &mut |_| ()).expect("a drive");
        let drive = match Drive::open(&out) {
            Ok(drive) => drive,
            Err(error) => panic!("{error}"),
        };
        assert_eq!((drive.model(), report.n_images), (model.into(), n_cameras));
        assert_eq!((drive.camera_frames().len(), drive.mosaic_frames().len()), (n_cameras as usize, 0));
        // Most close returns are road, and the body frame is at the height of the rig above it.
        let heights = heights_around(&drive);
        assert!(heights.len() > 500, "{}", heights.len());
        let road = heights[heights.len() / 3] + spec.rig.body_height_m;
        assert!(road.abs() < 0.2, "{name}: the road is at {road} m");
    }
}
