//! No reader panics or hangs on damaged bytes.

use damage::{attack, seed};
use formats::cloud::{CloudPoint, FiredCloud, FiredPoint};
use formats::cloud_fields::FormBuilder;
use formats::ladybug::LadybugCalibration;
use formats::pcd::{pcd_from_cloud, raw_from_pcd};
use formats::pgm::{Pgm, pgm_from_samples};
use formats::sensor_calibration::SensorCalibration;
use formats::tiff::Tiff;
use formats::trajectory::{
    TrajectoryError, csv_from_trajectory, kitti_from_trajectory, numbered, poses_from_kitti, trajectory_from_csv,
    trajectory_from_tum, tum_from_trajectory,
};
use formats::{envi, kitti};
use geometry::{Pose, Trajectory};

#[test]
fn damaged_clouds_and_images_do_not_panic() {
    let points: Vec<CloudPoint> = (0..100).map(|i| CloudPoint { x: i as f32, ..CloudPoint::default() }).collect();
    let fired = |i: u8| FiredPoint { point: points[usize::from(i)], ring: i, offset_nanos: u32::from(i) * 1_000_000 };
    let timed = pcd_from_cloud(&FiredCloud { points: (0..100).map(fired).collect(), has_rings: true, has_times: true });
    attack(11, 5000, &timed, |bytes| {
        let Ok(raw) = raw_from_pcd(bytes) else { return };
        let mut builder = FormBuilder::for_drive(Some(0.1), None);
        if builder.add(&raw, Some(0)).is_ok()
            && let Ok(cloud) = builder.finish().fired(&raw, 0)
        {
            assert!(cloud.points.iter().all(|p| p.offset_nanos <= 4_000_000_000 && (cloud.has_rings || p.ring == 0)));
        }
    });
    attack(9, 2000, &kitti::bin_from_points(&points), |bytes| {
        assert_eq!(kitti::points_from_bin(bytes).is_ok(), bytes.len() % 16 == 0);
        assert_eq!(kitti::labels_from_bytes(bytes).is_ok(), bytes.len() % 4 == 0);
    });
    attack(10, 5000, &pgm_from_samples(20, 10, 4095, &[77; 200]), |bytes| {
        if let Ok(image) = Pgm::parse(bytes) {
            assert_eq!(image.samples().len(), image.n_samples());
        }
    });
}

/// An uncompressed TIFF of 4 x 2 pixels with 4 bands of 16 bits.
fn tiff() -> Vec<u8> {
    let fields = [(256, 4), (257, 2), (258, 16), (259, 1), (262, 1), (273, 122), (277, 4), (278, 2), (279, 64)];
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    bytes.extend((fields.len() as u16).to_le_bytes());
    for (tag, value) in fields {
        bytes.extend([u16::to_le_bytes(tag), 4_u16.to_le_bytes()].concat());
        bytes.extend([1_u32.to_le_bytes(), u32::to_le_bytes(value)].concat());
    }
    bytes.extend([0; 4]);
    bytes.extend((0..32_u16).flat_map(u16::to_le_bytes));
    bytes
}

#[test]
fn damaged_tiffs_do_not_panic() {
    let bytes = tiff();
    let image = Tiff::parse(&bytes).expect("parses");
    assert_eq!((image.n_bands, image.samples), (4, (0..32).collect::<Vec<u16>>()));
    let mut read = 0;
    attack(24, 20_000, &bytes, |bytes| {
        if let Ok(image) = Tiff::parse(bytes) {
            assert_eq!(image.samples.len(), (image.width * image.height * image.n_bands) as usize);
            read += 1;
        }
    });
    assert!(read > 200, "{read}");
}

#[test]
fn tiff_that_needs_more_bytes_than_it_has_is_refused() {
    // All strips of ten rows are the same 655 340 bytes: 2 GB of image in 120 KB of file.
    let width = 32_767_u32;
    let height = 30_000_u32;
    let n_bands = 2_u32;
    let n_strips = 3_000_u32;
    let table = 8 + 2 + 10 * 12 + 4;
    let fields: [(u16, u16, u32, u32); 10] = [
        (256, 4, 1, width),
        (257, 4, 1, height),
        (258, 3, 1, 8),
        (259, 3, 1, 1),
        (262, 3, 1, 1),
        (273, 4, n_strips, table),
        (277, 3, 1, n_bands),
        (278, 4, 1, 10),
        (279, 4, n_strips, table + 4 * n_strips),
        (339, 3, 1, 1),
    ];
    let mut bytes = b"II*\0\x08\0\0\0".to_vec();
    bytes.extend((fields.len() as u16).to_le_bytes());
    for (tag, kind, count, value) in fields {
        bytes.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
        bytes.extend([count.to_le_bytes(), value.to_le_bytes()].concat());
    }
    bytes.extend([0; 4]);
    for number in [8, 10 * width * n_bands] {
        bytes.extend(number.to_le_bytes().repeat(n_strips as usize));
    }
    bytes.resize(120_000, 0);
    let error = Tiff::parse(&bytes).expect_err("refused").to_string();
    assert!(error.contains("needs 1966020000; the file has 120000 bytes"), "{error}");
}

#[test]
fn damaged_trajectories_do_not_panic() {
    let poses: Vec<Pose> = (0..20).map(|i| Pose::translation(f64::from(i), 0.5, -1e-3)).collect();
    let trajectory = numbered(&poses, 100_000_000);
    let check = |read: Result<Trajectory, TrajectoryError>| {
        if let Ok(trajectory) = read {
            assert!(trajectory.poses().is_sorted_by_key(|(stamp, _)| *stamp));
        }
    };
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    attack(25, 3000, tum_from_trajectory(&trajectory).as_bytes(), |bytes| check(trajectory_from_tum(&text(bytes))));
    attack(26, 3000, csv_from_trajectory(&trajectory).as_bytes(), |bytes| check(trajectory_from_csv(&text(bytes))));
    attack(27, 3000, kitti_from_trajectory(&trajectory).as_bytes(), |bytes| {
        if let Ok(poses) = poses_from_kitti(&text(bytes)) {
            assert!(poses.iter().all(|pose| (pose.rotation.norm() - 1.0).abs() < 1e-9));
        }
    });
}

#[test]
fn damaged_spectra_and_lens_calibrations_do_not_panic() {
    let spectrum = seed("ecostress");
    formats::ecostress::parse(&String::from_utf8_lossy(&spectrum)).expect("parses");
    attack(28, 3000, &spectrum, |bytes| {
        if let Ok(spectrum) = formats::ecostress::parse(&String::from_utf8_lossy(bytes)) {
            assert_eq!(spectrum.wavelengths_nm.len(), spectrum.reflectances.len());
        }
    });
    attack(29, 3000, &seed("ladybug"), |bytes| {
        let _ = String::from_utf8_lossy(bytes).parse::<LadybugCalibration>();
    });
}

fn attack_calibration(seed: u64, rounds: usize, text: &[u8]) {
    let mut refused = 0;
    let mut read = 0;
    attack(seed, rounds, text, |bytes| {
        let text = String::from_utf8_lossy(bytes);
        match SensorCalibration::from_xml(&text) {
            Ok(_) => read += 1,
            Err(error) => {
                let n_lines = text.lines().count().max(1) as u32 + 1;
                assert!((1..=n_lines).contains(&error.line), "{error} of {n_lines} lines");
                assert!(!error.element.is_empty() && !error.rule.is_empty(), "{error}");
                refused += 1;
            }
        }
    });
    assert!(refused > rounds / 4 && refused + read >= rounds, "{refused} refused, {read} read");
}

#[test]
fn damaged_calibrations_do_not_panic() {
    let seed = seed("sensor_calibration");
    let made = SensorCalibration::from_xml(&String::from_utf8_lossy(&seed)).expect("is valid");
    assert_eq!(made.to_xml().as_bytes(), seed);
    attack_calibration(21, 3000, &seed);
}

#[real_data::test(
    "photonfocus/CMV2K-SSM4x4-470_620-9.4.10.10_HS03-VIS.xml",
    "photonfocus/CMV2K-SSM5x5-665_975-13.8.15.1_HS02-NIR.xml"
)]
fn damaged_real_calibrations_do_not_panic() {
    for name in ["CMV2K-SSM4x4-470_620-9.4.10.10_HS03-VIS.xml", "CMV2K-SSM5x5-665_975-13.8.15.1_HS02-NIR.xml"] {
        let path = real_data::path(&format!("photonfocus/{name}"));
        attack_calibration(22, 100, &std::fs::read(path).expect("readable"));
    }
}

#[test]
fn damaged_cubes_do_not_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut header = envi::Header::new(6, 5, 4);
    header.wavelengths = vec![500.0, 510.0, 520.0, 530.0];
    header.wavelength_units = "nm".to_owned();
    let path = folder.path().join("cube.hdr");
    envi::write(&path, &envi::Image { header, values: vec![0.5; 120] }).expect("written");
    let text = std::fs::read(&path).expect("readable");
    let mut read = 0;
    attack(23, 1500, &text, |bytes| {
        std::fs::write(&path, bytes).expect("written");
        match envi::read(&path) {
            // An image has the size of its header and is never larger than the data file.
            Ok(image) => {
                let n = image.header.samples * image.header.lines * image.header.bands;
                assert!(image.values.len() == n && n <= 480, "{:?}", image.header);
                read += 1;
            }
            Err(error) => assert!(error.line != Some(0), "{error}"),
        }
    });
    assert!(read > 20, "{read}");
}
