//! Colors in front of the sky: a tree and a white wall below blue sky and white clouds.

use coloring::{
    AgeLimits, Candidates, ColorImage, ColorSteps, PointBuffers, ProjectionCamera, SubmapPoints, color_into,
    visibility_maps,
};
use geometry::{CameraModel, Isometry3, Pinhole, RigCamera, UnitQuaternion, Vector3};
use messages::{ColorRow, SubmapPoint, SubmapSweep, UNSEEN};
use std::f64::consts::FRAC_PI_2;

const WIDTH: u32 = 300;
const HEIGHT: u32 = 300;
/// Two pixels are a cell.
const PX_PER_RAD: f64 = 570.0;
const RANGE_M: f64 = 10.0;
/// Height of the points and of the image content, m above the camera: the pose is wrong by 0.1 m.
const POINTS_M: f64 = 1.0;
const SHOWN_M: f64 = 0.9;

const LEAF: [u8; 3] = [50, 60, 38];
const SUNLIT_LEAF: [u8; 3] = [105, 115, 70];
const THIN_LEAVES: [u8; 3] = [105, 122, 128];
const WALL: [u8; 3] = [236, 236, 236];
const BLUE_SKY: [u8; 3] = [140, 170, 215];
const CLOUD: [u8; 3] = [238, 239, 241];

/// The tree is left of this edge, the wall right of it, m to the left. The tree is larger: most of a street is darker
/// than the sky.
const EDGE_M: f64 = -1.0;

/// The color that a ray shows at `y` to the left and `z` above, m at `RANGE_M`.
fn shown(y: f64, z: f64) -> [u8; 3] {
    let is_sunlit = ((y / 0.06).floor() + (z / 0.06).floor()).rem_euclid(3.0) == 0.0;
    match (z < SHOWN_M, y > EDGE_M) {
        (true, true) if z > SHOWN_M - 0.04 => THIN_LEAVES,
        (true, true) if is_sunlit => SUNLIT_LEAF,
        (true, true) => LEAF,
        (true, false) => WALL,
        (false, _) if (y * 2.0).sin() > 0.3 => CLOUD,
        (false, _) => BLUE_SKY,
    }
}

/// Points of tree and wall, with their colors.
fn colors(reject_sky: bool) -> Vec<(SubmapPoint, ColorRow)> {
    let half = f64::from(WIDTH / 2);
    let pinhole = Pinhole {
        width: WIDTH,
        height: HEIGHT,
        fx: PX_PER_RAD,
        fy: PX_PER_RAD,
        cx: half,
        cy: half,
        distortion: [0.0; 5],
    };
    let forward = UnitQuaternion::from_euler_angles(-FRAC_PI_2, 0.0, -FRAC_PI_2);
    let body_from_camera = Isometry3::from_parts(Vector3::zeros().into(), forward);
    let camera = ProjectionCamera::from(&RigCamera { body_from_camera, model: CameraModel::Pinhole(pinhole) });
    let at = |pixel: u32| (half - f64::from(pixel)) / PX_PER_RAD * RANGE_M;
    let bytes: Vec<u8> = (0..HEIGHT).flat_map(|v| (0..WIDTH).flat_map(move |u| shown(at(u), at(v)))).collect();
    let image = ColorImage::new(0, WIDTH, HEIGHT, &bytes).expect("fits");

    let rows = (0..).map(|i| POINTS_M - 0.03 * f64::from(i)).take_while(|z| *z > -2.6);
    let row = |z: f64| (-85..85).map(move |i| [RANGE_M, 0.03 * f64::from(i) + 0.015, z].map(|p| p as f32));
    let points: Vec<SubmapPoint> =
        rows.flat_map(row).map(|[x, y, z]| SubmapPoint { x, y, z, ..SubmapPoint::default() }).collect();
    let sweeps = [SubmapSweep::default()];
    let mut buffers = PointBuffers::default();
    let submap = SubmapPoints::new(&points, &sweeps, 0, 32, &mut buffers);
    let exposures = [camera.exposure(0, &Isometry3::identity(), &Isometry3::identity())];
    let visibility = visibility_maps(&submap, &exposures);
    let limits = AgeLimits { max_age_s: 1.0, max_moving_age_s: 0.1 };
    let candidates = Candidates { points: &submap, exposures: &exposures, visibility: &visibility, limits };
    let mut colors = vec![ColorRow::default(); points.len()];
    color_into(&candidates, &[image], ColorSteps { level_exposures: false, reject_sky }, &mut colors);
    points.into_iter().zip(colors).collect()
}

fn is_bluish(row: ColorRow) -> bool {
    row.camera != UNSEEN && row.b > row.r
}

#[test]
fn rim_of_tree_gets_neither_color_of_sky_nor_of_sky_through_leaves() {
    let of_tree = |reject_sky| {
        colors(reject_sky).into_iter().filter(|(point, _)| f64::from(point.y) > EDGE_M).collect::<Vec<_>>()
    };
    let plain = of_tree(false);
    let tested = of_tree(true);
    let n_bluish = plain.iter().filter(|(_, row)| is_bluish(*row)).count();
    assert!(n_bluish > 200, "only {n_bluish} points of the plain colors show the sky");
    let bluish = || tested.iter().filter(|(_, row)| is_bluish(*row));
    assert_eq!(bluish().count(), 0, "{:?}", bluish().next());
    // More than a cell above the image content, there is no other color.
    let unseen = |rows: &[(SubmapPoint, ColorRow)]| rows.iter().filter(|(_, row)| row.camera == UNSEEN).count();
    assert!(unseen(&tested) > unseen(&plain) && unseen(&tested) < unseen(&plain) + n_bluish, "{}", unseen(&tested));
    let below = || plain.iter().zip(&tested).filter(|((point, _), _)| f64::from(point.z) < SHOWN_M - 0.1);
    let changed = || below().filter(|(plain, tested)| plain.1 != tested.1);
    assert_eq!(changed().count(), 0, "leaves in the sun keep their color: {:?}", changed().next());
}

#[test]
fn white_wall_keeps_its_color_below_white_clouds() {
    let colors = colors(true);
    let is_wall = |point: &SubmapPoint| f64::from(point.y) < EDGE_M - 0.1 && f64::from(point.z) < SHOWN_M - 0.05;
    let wall = || colors.iter().filter(|(point, _)| is_wall(point));
    assert!(wall().count() > 5000, "{}", wall().count());
    let others = || wall().filter(|(_, row)| [row.r, row.g, row.b] != WALL);
    assert_eq!(others().count(), 0, "{:?}", others().next());
}
