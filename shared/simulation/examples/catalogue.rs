//! Draws every model of the simulator with its own color camera: `catalogue OUT_DIR [SEED] [PART_OF_NAME]`.
//!
//! Writes sheets `catalogue_1.png` … of 4 by 3 pictures and prints the models' names in their order, row by row, with their
//! sizes.

use geometry::{CameraModel, Pinhole, Pose, Translation3, UnitQuaternion, Vector3};
use nalgebra::Rotation3;
use simulation::scene::catalogue::{Exhibit, exhibits};
use simulation::sensors::camera::ColorCamera;
use std::error::Error;
use std::path::PathBuf;

const WIDTH: u32 = 400;
const HEIGHT: u32 = 300;
const COLUMNS: usize = 4;
const ROWS: usize = 3;
const FOCAL_PX: f64 = 480.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let out = PathBuf::from(arguments.next().ok_or("usage: catalogue OUT_DIR [SEED] [PART_OF_NAME]")?);
    let seed: u64 = arguments.next().map_or(Ok(1), |seed| seed.parse())?;
    let part = arguments.next().unwrap_or_default();
    std::fs::create_dir_all(&out)?;
    let camera = ColorCamera::new(&CameraModel::Pinhole(Pinhole {
        width: WIDTH,
        height: HEIGHT,
        fx: FOCAL_PX,
        fy: FOCAL_PX,
        cx: f64::from(WIDTH) / 2.0,
        cy: f64::from(HEIGHT) / 2.0,
        distortion: [0.0; 5],
    }));
    let shown: Vec<Exhibit> = exhibits(seed).filter(|exhibit| exhibit.name.contains(&part)).collect();
    for (sheet, exhibits) in shown.chunks(COLUMNS * ROWS).enumerate() {
        let (width, height) = (WIDTH * COLUMNS as u32, HEIGHT * ROWS as u32);
        let mut pixels = vec![0_u8; (3 * width * height) as usize];
        for (i, exhibit) in exhibits.iter().enumerate() {
            let size = exhibit.bounds[1] - exhibit.bounds[0];
            let classes: Vec<&str> = exhibit.classes.iter().map(|class| class.name()).collect();
            println!(
                "{:2} {:28} {:5.1} x {:5.1} x {:5.1} m, {:5} primitives, {}",
                sheet + 1,
                exhibit.name,
                size.x,
                size.y,
                size.z,
                exhibit.n_primitives,
                classes.join(", ")
            );
            let picture = camera.shoot(&exhibit.scene, &exhibit.scene.at(0.0), &viewpoint(exhibit), seed);
            let (column, row) = (i % COLUMNS, i / COLUMNS);
            for (v, line) in picture.chunks_exact(3 * WIDTH as usize).enumerate() {
                let at = 3 * ((row * HEIGHT as usize + v) * width as usize + column * WIDTH as usize);
                pixels[at..at + line.len()].copy_from_slice(line);
            }
        }
        let path = out.join(format!("catalogue_{}.png", sheet + 1));
        image::save_buffer(path, &pixels, width, height, image::ExtendedColorType::Rgb8)?;
    }
    Ok(())
}

/// From the front and the right, so near that all of it is just seen. The sun stands behind the camera.
fn viewpoint(exhibit: &Exhibit) -> Pose {
    let [low, high] = exhibit.bounds.map(nalgebra::Matrix::cast::<f64>);
    let low = Vector3::new(low.x, low.y, low.z.max(-1.5));
    let middle = (low + high) * 0.5;
    let backward = Vector3::new(-0.62, -0.85, 0.32).normalize();
    let right = (-backward).cross(&Vector3::z()).normalize();
    let down = (-backward).cross(&right);
    // Each corner of the bounds asks for the distance at which it lies on the picture's edge.
    let distance = (0..8)
        .map(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
            let corner = Vector3::new(pick(0), pick(1), pick(2)) - middle;
            let across = (corner.dot(&right).abs() / (0.47 * f64::from(WIDTH)))
                .max(corner.dot(&down).abs() / (0.47 * f64::from(HEIGHT)));
            corner.dot(&backward) + FOCAL_PX * across
        })
        .fold(1.0, f64::max);
    let rotation = Rotation3::from_basis_unchecked(&[right, down, -backward]);
    Pose::from_parts(Translation3::from(middle + backward * distance), UnitQuaternion::from_rotation_matrix(&rotation))
}
