//! `replica inspect DRIVE`.

use crate::support::{printed, replica, succeeded, text};
use drive::Drive;
use image::{Rgb, RgbImage};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Time between two images, ns.
const PERIOD: i64 = 200_000_000;
const SECONDS: i64 = 8;

/// Eight seconds by LiDAR, IMU and GNSS, and two cameras with small images five times per second.
struct Recorded {
    folder: PathBuf,
    /// Stamp of the first sweep.
    begin: i64,
}

impl Recorded {
    fn new(folder: &Path) -> Self {
        let folder = folder.join("drive");
        let seconds = SECONDS.to_string();
        let arguments = ["simulate", "--seed", "3", "--seconds", &seconds, "--rig", "survey", "--out", text(&folder)];
        succeeded(&replica(&arguments));
        let mut source = Drive::open(&folder).expect("opens").sweeps().expect("opens");
        let begin = source.next_sweep(|_| {}).expect("reads").expect("has sweeps").stamp.0;
        let recorded = Self { folder, begin };
        let mut manifest = std::fs::read_to_string(recorded.folder.join("drive.toml")).expect("reads");
        manifest = manifest.replace("camera = []\n", "");
        for camera in 0..2 {
            let _ = write!(
                manifest,
                "\n[[camera]]\nname = \"side {camera}\"\nfolder = \"camera/{camera}\"\nexposure_nanos = 2000000\n\
                 body_from_camera = {{ translation = [0, 0, 1], rotation = [0, 0, 0, 1] }}\n\
                 model = {{ kind = \"pinhole\", width = 64, height = 48, fx = 60.0, fy = 60.0, cx = 32.0, cy = 24.0 }}\n"
            );
            for image in 0..SECONDS * 1_000_000_000 / PERIOD {
                recorded.write_image(camera, image * PERIOD, 120);
            }
        }
        std::fs::write(recorded.folder.join("drive.toml"), manifest).expect("writes");
        recorded
    }

    fn image(&self, camera: usize, nanos: i64) -> PathBuf {
        self.folder.join(format!("camera/{camera}/{}.jpg", self.begin + nanos))
    }

    fn write_image(&self, camera: usize, nanos: i64, gray: u8) {
        let path = self.image(camera, nanos);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        RgbImage::from_pixel(64, 48, Rgb([gray; 3])).save(path).expect("writes");
    }

    /// Removes the images of a camera between two times, s.
    fn remove_images(&self, camera: usize, from_s: i64, to_s: i64) {
        for image in (from_s * 1_000_000_000..to_s * 1_000_000_000).step_by(PERIOD as usize) {
            std::fs::remove_file(self.image(camera, image)).expect("removed");
        }
    }

    fn replace_lines(&self, name: &str, change: impl Fn(usize, &str) -> String) {
        let path = self.folder.join(name);
        let lines = std::fs::read_to_string(&path).expect("reads");
        let changed: String = lines.lines().enumerate().map(|(k, line)| change(k, line) + "\n").collect();
        std::fs::write(path, changed).expect("writes");
    }

    fn inspect(&self, code: i32, words: &[&str]) -> String {
        let output = replica(&["inspect", text(&self.folder)]);
        let said = printed(&output);
        assert_eq!(output.status.code(), Some(code), "{said}");
        for word in words {
            assert!(said.contains(word), "{word:?} is not in\n{said}");
        }
        said
    }
}

#[test]
fn sound_drive_is_described_without_doubts() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = Recorded::new(folder.path());
    let said = drive.inspect(
        0,
        &[
            "Doubts: none",
            "lidar packets",
            "camera 1 (side 1)",
            "sweeps: about 80",
            "rings: 32; without returns: ",
            "mean specific force: 9.",
            "fixes: 9 (differential 9)",
            "3 of 3 images decoded; brightness 47 %, 47 %, 47 %",
            "ground truth: trajectory and labels",
            "--without calibrate",
        ],
    );
    let cells = |name: &str| {
        let line = said.lines().find(|line| line.starts_with(name)).expect("is in the table");
        line.split("  ").filter(|cell| !cell.is_empty()).map(|cell| cell.trim().to_owned()).collect::<Vec<_>>()
    };
    let camera = cells("camera 0");
    assert_eq!(camera[1..3], ["64 x 48", "40"], "{camera:?}");
    assert_eq!(camera[4..], ["40", "5.00", "0.00", "0", "-"], "{camera:?}");
    assert_eq!(cells("imu")[5], "100.00");

    // The whole drive, and the self-contained page.
    let page = folder.path().join("page.html");
    let full = succeeded(&replica(&["inspect", text(&drive.folder), "--full", "--page", text(&page)]));
    assert!(full.contains("lidar sweeps") && full.contains("40 of 40 images decoded"), "{full}");
    let page = std::fs::read_to_string(page).expect("was written");
    assert_eq!(page.matches("<img src=\"data:image/").count(), 3, "a picture of each camera and one of the LiDAR");
    assert!(page.matches("<svg").count() >= 3 && !page.contains("src=\"http") && page.contains("No doubts."));
    for word in ["camera 0 (side 0), first image", "Path by GNSS", "mean specific force"] {
        assert!(page.contains(word), "{word}");
    }
}

#[test]
fn doubts_name_sensor_time_and_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let drive = Recorded::new(folder.path());
    drive.remove_images(0, 2, 3);
    drive.remove_images(1, 5, SECONDS);
    let said = drive.inspect(
        3,
        &["camera 1 (side 1) ends 3.", "gaps of camera 0 (side 0) (longer than 0.600 s): 1.200 s at +1.800 s"],
    );
    assert_eq!(said.matches("\n  - ").count(), 1, "{said}");

    // The first image is black, the middle one damaged.
    drive.write_image(0, 0, 2);
    let middle = drive.image(0, 4_400_000_000);
    std::fs::write(&middle, b"no image").expect("writes");
    drive.inspect(3, &["has a mean brightness of 0.8 %", "2 of 3 images decoded"]);
    for image in 0..25 {
        std::fs::remove_file(drive.image(1, image * PERIOD)).expect("removed");
    }
    drive.inspect(3, &["camera 1 (side 1): no image in folder camera/1"]);
    // An hour of summer time.
    for image in 0..40 {
        drive.write_image(1, 3_600_000_000_000 + image * PERIOD, 120);
    }
    drive.inspect(3, &["clocks: camera 1 (side 1) is +3599.9 s off the LiDAR", "+1 hours: one clock shows local time"]);

    drive.replace_lines("imu.csv", |k, line| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if k > 0 {
            for cell in &mut cells[1..4] {
                *cell = (cell.parse::<f64>().expect("a number") / 9.806_65).to_string();
            }
        }
        if k == 5 { "damaged".to_owned() } else { cells.join(",") }
    });
    drive.inspect(3, &["the unit seems to be g", "imu: 1 lines are damaged, the first: ", "imu.csv: line 6: "]);
}

#[test]
fn gap_of_the_lidar_and_jump_of_the_receiver_are_found() {
    use lidar::nmea::{Fix, gga_from_fix, rmc_from_fix};
    use lidar::pcap::{PacketReader, Writer};

    let folder = tempfile::tempdir().expect("a folder");
    let drive = Recorded::new(folder.path());
    let capture = Drive::open(&drive.folder).expect("opens").sweep_files()[0].clone();
    let mut reader = PacketReader::open(&capture).expect("opens");
    let mut kept = Writer::new(Vec::new()).expect("writes");
    let mut first = None;
    while let Some(packet) = reader.next().expect("reads") {
        let first = *first.get_or_insert(packet.stamp.0);
        // Half a second is missing.
        if !(3_000_000_000..3_500_000_000).contains(&(packet.stamp.0 - first)) {
            kept.write_udp(packet.stamp, packet.port, packet.payload).expect("writes");
        }
    }
    std::fs::write(&capture, kept.finish().expect("finishes")).expect("writes");
    let (fixes, _) = Drive::open(&drive.folder).expect("opens").fixes().expect("reads");
    let lines = fixes.iter().enumerate().flat_map(|(k, fix)| {
        let north_deg = if k >= 4 { 0.01 } else { 0.0 };
        let moved = Fix { position_deg: [fix.position_deg[0] + north_deg, fix.position_deg[1]], ..*fix };
        [gga_from_fix(&moved, 44.6), rmc_from_fix(&moved)]
    });
    std::fs::write(drive.folder.join("gnss.nmea"), lines.map(|line| line + "\r\n").collect::<String>())
        .expect("writes");
    drive.inspect(
        3,
        &[
            "gaps of lidar packets (longer than 0.050 s): 0.50",
            " s at +",
            "gnss: 1 jumps faster than 70 m/s, the first of 11",
        ],
    );
}

#[real_data::test("velodyne/hdl32e_outdoor.pcap")]
fn real_capture_is_described_and_its_cut_end_is_named() {
    let path = real_data::path("velodyne/hdl32e_outdoor.pcap");
    let output = replica(&["inspect", text(&path)]);
    let said = printed(&output);
    assert_eq!(output.status.code(), Some(3), "{said}");
    for word in [
        "HDL-32E",
        "LiDAR minus capturing machine: -1776.840 s",
        "ends inside the packet at byte",
        "  603  ",
        "rings: 32; without returns: 0",
    ] {
        assert!(said.contains(word), "{word:?} is not in\n{said}");
    }
}

#[real_data::test("velodyne/vlp16_moving_car.pcap")]
fn real_receiver_in_position_packets_is_found() {
    let path = real_data::path("velodyne/vlp16_moving_car.pcap");
    let said = printed(&replica(&["inspect", text(&path)]));
    for word in ["  291  ", "gnss", "position packets", "capturing machine minus GNSS of the position packets"] {
        assert!(said.contains(word), "{word:?} is not in\n{said}");
    }
}

#[real_data::test("kitti_raw_0048/*.pcd")]
fn real_folder_of_sweeps_is_described() {
    let said = succeeded(&replica(&["inspect", text(&real_data::path("kitti_raw_0048"))]));
    for word in ["lidar sweeps", "  22  ", "sweeps: 22, 10.00 per second", "points have no times", "rings: 64"] {
        assert!(said.contains(word), "{word:?} is not in\n{said}");
    }
}

#[real_data::test("nuscenes/*.pcd.bin")]
fn real_nuscenes_folder_is_refused_with_the_reason() {
    let output = replica(&["inspect", text(&real_data::path("nuscenes"))]);
    assert_eq!(output.status.code(), Some(1), "{}", printed(&output));
    assert!(printed(&output).contains("is a sweep of nuScenes"), "{}", printed(&output));
}
