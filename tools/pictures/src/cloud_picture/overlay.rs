//! Overlays of a picture: legend, and on a view from above the path, a scale bar and north.

use super::camera::Camera;
use super::palette::{Legend, ramp};
use super::text::{LETTER, draw, fill, width};
use image::RgbImage;

const BLACK: [u8; 3] = [0; 3];
const WHITE: [u8; 3] = [255; 3];
/// The path of the LiDAR.
const PATH: [u8; 3] = [255, 140, 0];
/// Distance of everything from the border and from each other, px.
const GAP: u32 = 12;
/// Longest scale bar, px.
const MAX_BAR: f64 = 220.0;
/// Width of the ramp of a legend, px.
const RAMP: u32 = 220;

/// Draws all overlays. `path`: positions of the LiDAR.
pub fn draw_over(image: &mut RgbImage, camera: &Camera, legend: &Legend, path: &[[f64; 3]]) {
    if camera.is_top_view() {
        draw_path(image, camera, path);
        draw_scale(image, camera.px_per_m());
        draw_north(image);
    }
    draw_legend(image, legend);
}

/// The largest of 1, 2 or 5 times a power of ten up to a length.
pub fn round_length(longest: f64) -> f64 {
    let power = 10.0_f64.powf(longest.max(1e-3).log10().floor());
    [5.0, 2.0].map(|k| k * power).into_iter().find(|length| *length <= longest).unwrap_or(power)
}

/// A line through all positions, with a disk at the first.
fn draw_path(image: &mut RgbImage, camera: &Camera, path: &[[f64; 3]]) {
    let pixels: Vec<[f64; 2]> = path.iter().filter_map(|p| camera.project(*p)).map(|at| [at.u, at.v]).collect();
    for pair in pixels.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        let n_steps = (b[0] - a[0]).hypot(b[1] - a[1]).ceil().clamp(1.0, 1e4);
        for step in 0..=n_steps as u32 {
            let share = f64::from(step) / n_steps;
            dot(image, [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])], 1.5);
        }
    }
    if let Some(begin) = pixels.first() {
        dot(image, *begin, 6.0);
    }
}

fn dot(image: &mut RgbImage, [u, v]: [f64; 2], radius: f64) {
    let inside = u >= radius && v >= radius;
    if inside {
        let side = (2.0 * radius) as u32;
        fill(image, [(u - radius) as u32, (v - radius) as u32], [side, side], PATH);
    }
}

/// A bar of a round length at the bottom left.
fn draw_scale(image: &mut RgbImage, px_per_m: f64) {
    let bar_m = round_length(MAX_BAR.min(0.3 * f64::from(image.width())) / px_per_m);
    let label = format!("{bar_m} m");
    let bar = (bar_m * px_per_m) as u32;
    let side = [bar.max(width(&label)) + 2 * GAP, LETTER + 2 * GAP + 10];
    let [left, top] = [GAP, image.height().saturating_sub(side[1] + GAP)];
    panel(image, [left, top], side);
    draw(image, [left + GAP, top + GAP / 2], &label, BLACK);
    fill(image, [left + GAP, top + GAP + LETTER + 2], [bar, 4], BLACK);
    for end in [0, bar.saturating_sub(2)] {
        fill(image, [left + GAP + end, top + GAP + LETTER - 4], [2, 16], BLACK);
    }
}

/// An arrow to the top at the top right: views from above have north up.
fn draw_north(image: &mut RgbImage) {
    let side = [LETTER + 2 * GAP, LETTER + 2 * GAP + 24];
    let [left, top] = [image.width().saturating_sub(side[0] + GAP), GAP];
    panel(image, [left, top], side);
    let middle = left + side[0] / 2;
    for row in 0..24 {
        fill(image, [middle - row / 3, top + GAP / 2 + row], [1 + 2 * (row / 3), 1], BLACK);
    }
    draw(image, [middle - LETTER / 2, top + GAP + 26], "N", BLACK);
}

/// The legend, at the top left.
fn draw_legend(image: &mut RgbImage, legend: &Legend) {
    let origin = [GAP, GAP];
    match legend {
        Legend::Names(names) => {
            let widest = names.iter().map(|(_, name)| width(name)).max().unwrap_or_default();
            let row = LETTER + GAP / 2;
            panel(image, origin, [widest + LETTER + 3 * GAP, row * names.len() as u32 + 2 * GAP - GAP / 2]);
            for ((color, name), top) in names.iter().zip((2 * GAP..).step_by(row as usize)) {
                fill(image, [2 * GAP, top], [LETTER, LETTER], *color);
                draw(image, [3 * GAP + LETTER, top], name, BLACK);
            }
        }
        Legend::Ramp { title, ends: [low, high] } => {
            let widest = width(title).max(RAMP).max(width(low) + width(high) + GAP);
            panel(image, origin, [widest + 2 * GAP, 3 * LETTER + 3 * GAP]);
            draw(image, [2 * GAP, 2 * GAP], title, BLACK);
            let top = 2 * GAP + LETTER + GAP / 2;
            for x in 0..widest {
                fill(image, [2 * GAP + x, top], [1, LETTER], ramp(f64::from(x) / f64::from(widest)));
            }
            let below = top + LETTER + GAP / 2;
            draw(image, [2 * GAP, below], low, BLACK);
            draw(image, [2 * GAP + widest - width(high), below], high, BLACK);
        }
    }
}

/// A light background on which black is readable; the points behind it show through.
fn panel(image: &mut RgbImage, [left, top]: [u32; 2], [width, height]: [u32; 2]) {
    for y in top..(top + height).min(image.height()) {
        for x in left..(left + width).min(image.width()) {
            let pixel = image.get_pixel_mut(x, y);
            pixel.0 = std::array::from_fn(|k| ((u16::from(pixel.0[k]) + 6 * u16::from(WHITE[k])) / 7) as u8);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::settings::PictureSize;
    use super::*;

    const SIZE: PictureSize = PictureSize { width: 800, height: 400 };

    fn drawn(camera: &Camera) -> RgbImage {
        let mut image = RgbImage::from_pixel(800, 400, image::Rgb([200; 3]));
        let legend = Legend::Names(vec![([1, 2, 250], "road".to_owned())]);
        draw_over(&mut image, camera, &legend, &[[10.0, 10.0, 1.0], [70.0, 30.0, 1.0]]);
        image
    }

    fn count(image: &RgbImage, color: [u8; 3]) -> usize {
        image.pixels().filter(|pixel| pixel.0 == color).count()
    }

    #[test]
    fn round_lengths_are_1_2_or_5() {
        assert_eq!([9.9, 10.0, 24.0, 0.3].map(round_length), [5.0, 10.0, 20.0, 0.2]);
    }

    #[test]
    fn view_from_above_has_path_bar_and_legend() {
        let image = drawn(&Camera::top_view([[0.0; 3], [80.0, 40.0, 5.0]], &[], SIZE));
        assert_eq!(count(&image, [1, 2, 250]), (LETTER * LETTER) as usize, "swatch");
        assert!((1500..4000).contains(&count(&image, PATH)), "{}", count(&image, PATH));
        // 10 px per m: the bar has 20 m.
        let rows = (0..400).map(|y| (0..400).filter(|x| image.get_pixel(*x, y).0 == BLACK && y > 340).count());
        assert_eq!(rows.filter(|n| (200..216).contains(n)).count(), 4, "height of the bar");
    }

    #[test]
    fn perspective_has_only_the_legend() {
        let path: Vec<[f64; 3]> = (0..40).map(|x| [f64::from(x), 0.0, 1.0]).collect();
        let image = drawn(&Camera::street_view([[0.0; 3], [80.0, 40.0, 5.0]], &path, 0.5, SIZE));
        assert_eq!((count(&image, PATH), count(&image, [1, 2, 250])), (0, (LETTER * LETTER) as usize));
    }
}
