//! Point clouds.

use crate::accepted::accepted;
use candle_core::Tensor;
use drive::returns_from_cloud;
use formats::cloud::check_points;
use formats::cloud_fields::{FormBuilder, IntensityScale, RawCloud};
use formats::ply::Vertices;
use lidar::velodyne::Model;
use std::io::Write;
use std::path::Path;

pub(crate) fn ply(bytes: &[u8]) {
    let decoded = Vertices::decode(bytes.to_vec(), Path::new("fuzz.ply"));
    accepted(&decoded);
    let Ok(vertices) = decoded else { return };
    for property in vertices.properties() {
        if let Ok(values) = vertices.f64s(&property.name) {
            assert_eq!(values.len(), vertices.len());
        }
        let _ = (vertices.i64s(&property.name), vertices.u8s(&property.name), vertices.f32s(&property.name));
    }
    if let Ok(cloud) = vertices.raw_cloud() {
        fired(&cloud);
    }
}

pub(crate) fn pcd(bytes: &[u8]) {
    let read = formats::pcd::points_from_pcd(bytes);
    accepted(&read);
    if let Ok(points) = read {
        let returns = returns_from_cloud(&points, &Model::Hdl64e.into());
        assert!(returns.iter().all(|one| one.azimuth < 36_000 && one.ring < 64 && one.x.is_finite()));
    }
    if let Ok(cloud) = formats::pcd::raw_from_pcd(bytes) {
        fired(&cloud);
    }
}

/// Reads a cloud as the only one of a recording, from a drive and from another writer.
fn fired(cloud: &RawCloud) {
    for mut builder in [FormBuilder::for_drive(Some(0.1), Some(16)), FormBuilder::new(None, None)] {
        if builder.add(cloud, Some(1_700_000_000_000_000_000)).is_err() {
            continue;
        }
        let form = builder.finish();
        let _ = cloud.check_extent(form.origin, 300.0);
        assert!(IntensityScale::is_factor(form.intensities.factor));
        if let Ok(fired) = form.fired(cloud, 1_700_000_000_000_000_000) {
            assert_eq!(fired.points.len(), cloud.positions.len());
            let bytes = formats::pcd::pcd_from_cloud(&fired);
            assert!(
                formats::pcd::raw_from_pcd(&bytes).is_ok_and(|again| again.positions.len() == cloud.positions.len())
            );
        }
    }
}

pub(crate) fn kitti(bytes: &[u8]) {
    let read = formats::kitti::points_from_bin(bytes);
    accepted(&read);
    if let Ok(points) = read {
        let _ = check_points(&points, 1.0);
        let _ = returns_from_cloud(&points, &Model::Hdl32e.into());
    }
    let _ = formats::kitti::labels_from_bytes(bytes);
}

pub(crate) fn nuscenes(bytes: &[u8]) {
    let read = formats::nuscenes::points_from_bin(bytes);
    accepted(&read);
    if let Ok(points) = read {
        assert!(points.iter().all(|(_, ring)| *ring < 32));
    }
}

/// Reads `SemanticKITTI` files as `replica-lab evaluate` does.
pub(crate) fn npy(bytes: &[u8]) {
    let checked = formats::npy::check_header(bytes);
    accepted(&checked);
    if checked.is_ok() {
        // The reader takes a path.
        let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
        file.write_all(bytes).expect("writes");
        let _ = Tensor::read_npy(file.path());
    }
}
