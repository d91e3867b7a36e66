//! Faults of cameras.

use crate::support::{Copied, turn, with_cameras};
use geometry::{CameraModel, KannalaBrandt, Vector3};

const CAMERA: &str = "CAM_FRONT";

#[test]
fn right_rig_has_no_doubt() {
    assert_eq!(Copied::from_recorded(with_cameras()).doubts(), [""; 0]);
}

#[test]
fn turned_camera_is_found_near_and_far_from_its_mounting() {
    for degrees in [1.2, -10.0] {
        let mut copied = Copied::from_recorded(with_cameras());
        turn(&mut copied.manifest.cameras[0].body_from_camera, Vector3::y(), degrees, false);
        assert_eq!(copied.doubts(), [format!("{CAMERA} mounting")], "{degrees} degrees");
    }
}

#[test]
fn other_axes_inverse_pose_and_exchanged_folders_are_found() {
    let mut copied = Copied::from_recorded(with_cameras());
    turn(&mut copied.manifest.cameras[0].body_from_camera, Vector3::z(), 180.0, false);
    assert_eq!(copied.doubts(), [format!("{CAMERA} mounting")]);

    let mut copied = Copied::from_recorded(with_cameras());
    let entry = &mut copied.manifest.cameras[0].body_from_camera;
    *entry = entry.to_pose().expect("a pose").inverse().into();
    assert_eq!(copied.doubts(), [format!("{CAMERA} mounting")]);

    let mut copied = Copied::from_recorded(with_cameras());
    let [first, second, ..] = &mut copied.manifest.cameras[..] else { panic!("two cameras") };
    std::mem::swap(&mut first.folder, &mut second.folder);
    assert_eq!(copied.doubts(), ["CAM_FRONT mounting", "CAM_BACK_RIGHT mounting"]);
}

#[test]
fn wrong_lens_is_found() {
    let mut copied = Copied::from_recorded(with_cameras());
    let CameraModel::Pinhole(lens) = &mut copied.manifest.cameras[0].model else { panic!("a pinhole") };
    lens.fx *= 2.0;
    lens.fy *= 2.0;
    assert_eq!(copied.doubts(), [format!("{CAMERA} lens")]);

    // The camera with the widest view.
    let mut copied = Copied::from_recorded(with_cameras());
    let CameraModel::Pinhole(lens) = copied.manifest.cameras[2].model.clone() else { panic!("a pinhole") };
    copied.manifest.cameras[2].model = CameraModel::KannalaBrandt(KannalaBrandt {
        width: lens.width,
        height: lens.height,
        fx: lens.fx,
        fy: lens.fy,
        cx: lens.cx,
        cy: lens.cy,
        distortion: [0.0; 4],
        max_angle: 1.5,
    });
    assert_eq!(copied.doubts(), ["CAM_BACK lens"]);
}

#[test]
fn late_images_are_found_from_hundredths_of_a_second_to_leap_seconds_and_zones() {
    for millis in [60, -500] {
        let copied = Copied::from_recorded(with_cameras()).with_images_late(millis * 1_000_000);
        assert_eq!(copied.doubts(), ["cameras delay"], "{millis} ms");
    }
    let names = ["CAM_FRONT clock", "CAM_BACK_RIGHT clock", "CAM_BACK clock"];
    for seconds in [18, -7200] {
        let copied = Copied::from_recorded(with_cameras()).with_images_late(seconds * 1_000_000_000);
        assert_eq!(copied.doubts(), names, "{seconds} s");
    }
}
