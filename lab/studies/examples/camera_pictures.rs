//! Images for `docs/explanation/simulation.md`, section Cameras, and the time per image.
//!
//! ```sh
//! cargo run --release -p studies --example camera_pictures -- docs 1 6.25
//! ```
//!
//! Folder, seed of the town, and second of the drive.

#[allow(clippy::unwrap_used, reason = "an example ends with its first error")]
fn main() {
    let mut arguments = std::env::args().skip(1);
    let folder = std::path::PathBuf::from(arguments.next().unwrap_or_else(|| "docs".to_owned()));
    let seed: u64 = arguments.next().map_or(1, |seed| seed.parse().unwrap());
    let seconds: f64 = arguments.next().map_or(6.25, |seconds| seconds.parse().unwrap());
    std::fs::create_dir_all(&folder).unwrap();
    let simulation = simulation::Simulation::new(&simulation::DriveSpec::urban(seed, seconds + 1.0)).unwrap();
    let stamp = simulation.motion.begin.plus_nanos((seconds * 1e9) as i64);
    pictures::six_cameras(&simulation, stamp).save(folder.join("cameras.jpg")).unwrap();
    pictures::raw_mosaic(&simulation, stamp).save(folder.join("raw_mosaic.png")).unwrap();
    pictures::levels(&simulation, stamp);
}

mod pictures {
    use geometry::Stamp;
    use image::imageops::{FilterType, crop_imm, replace, resize};
    use image::{GrayImage, RgbImage};
    use simulation::Simulation;
    use simulation::sensors::camera::ColorCamera;
    use simulation::sensors::mosaic::{MosaicCamera, SIZE};
    use std::time::Instant;

    /// Above left ahead, ahead, right ahead; below left back, right back, up.
    #[allow(clippy::unwrap_used, reason = "an example ends with its first error")]
    pub fn six_cameras(simulation: &Simulation, stamp: Stamp) -> RgbImage {
        let camera = ColorCamera::new(&simulation.rig.cameras[0].lens);
        let begin = Instant::now();
        let images = simulation.images(&camera, &[0, 1, 2, 3, 4, 5], stamp);
        println!("{:.0} ms per color image", begin.elapsed().as_secs_f64() * 1e3 / images.len() as f64);
        let [width, height] = camera.size();
        let mut sheet = RgbImage::new(3 * width, 2 * height);
        for (place, index) in [4, 0, 1, 3, 2, 5].into_iter().enumerate() {
            let picture = RgbImage::from_raw(width, height, images[index].clone()).unwrap();
            let place = place as u32;
            replace(&mut sheet, &picture, i64::from(place % 3 * width), i64::from(place / 3 * height));
        }
        resize(&sheet, 3 * width * 3 / 4, 2 * height * 3 / 4, FilterType::CatmullRom)
    }

    /// Above HS02, below HS03: the whole frame at a quarter of its size, and a piece of 96 x 68 px eight times enlarged, in
    /// which the pattern shows. Levels are stretched.
    #[allow(clippy::unwrap_used, reason = "an example ends with its first error")]
    pub fn raw_mosaic(simulation: &Simulation, stamp: Stamp) -> GrayImage {
        let width = SIZE[0] as u32 / 4;
        let height = SIZE[1] as u32 / 4;
        let mut sheet = GrayImage::new(2 * width, 2 * height);
        for (index, mosaic) in simulation.rig.mosaics.iter().enumerate() {
            let name = &mosaic.name;
            let camera = MosaicCamera::new(mosaic.sensor.clone(), &mosaic.lens);
            let begin = Instant::now();
            let samples = simulation.mosaic(&camera, index, stamp);
            println!("{:.0} ms per image of {name}", begin.elapsed().as_secs_f64() * 1e3);
            let mut sorted = samples.clone();
            sorted.sort_unstable();
            let white = f32::from(sorted[sorted.len() * 99 / 100]).max(1.0);
            let gray = samples.iter().map(|s| (255.0 * (f32::from(*s) / white).min(1.0).sqrt()) as u8).collect();
            let frame = GrayImage::from_raw(SIZE[0] as u32, SIZE[1] as u32, gray).unwrap();
            let whole = resize(&frame, width, height, FilterType::Triangle);
            let piece = crop_imm(&frame, 1000, 640, width / 8, height / 8).to_image();
            let piece = resize(&piece, width, height, FilterType::Nearest);
            replace(&mut sheet, &whole, 0, i64::from(index as u32 * height));
            replace(&mut sheet, &piece, i64::from(width), i64::from(index as u32 * height));
        }
        sheet
    }

    /// How the samples of HS03 spread over the range at a short and at a long exposure.
    pub fn levels(simulation: &Simulation, stamp: Stamp) {
        for milliseconds in [5, 100] {
            let mosaic = &simulation.rig.mosaics[1];
            let camera = MosaicCamera::new(mosaic.sensor.clone(), &mosaic.lens).exposed(milliseconds * 1_000_000);
            let samples = simulation.mosaic(&camera, 1, stamp);
            let share = |low: u16, high: u16| {
                100.0 * samples.iter().filter(|s| (low..=high).contains(*s)).count() as f64 / samples.len() as f64
            };
            println!(
                "hs03 at {milliseconds} ms: {:.0} % of the samples in the lowest eighth of the range, {:.0} % saturated",
                share(0, 127),
                share(1023, 1023)
            );
        }
    }
}
