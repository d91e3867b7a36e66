//! Small pictures for the page: images of cameras, and the first sweep from above.

use super::stream::{Stream, seconds_between};
use formats::lidar::SweepPoint;
use geometry::{Point3, Pose, Stamp};
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageFormat, Rgb, RgbImage};
use std::fmt::Write;
use std::io::Cursor;

/// Width of a picture of a camera, px.
const WIDTH: u32 = 480;
const JPEG_QUALITY: u8 = 80;
/// Side of the top view, px.
const SIDE: u32 = 720;
/// The top view shows between these distances, m: 95 % of the points.
const REACH_M: [f32; 2] = [15.0, 100.0];
/// Heights from blue to red, m over the lowest 5 % of the points.
const HEIGHT_M: f32 = 6.0;

/// A picture of the page.
pub struct Picture {
    pub title: String,
    /// Media type.
    kind: &'static str,
    bytes: Vec<u8>,
}

impl Picture {
    /// The picture as the address of an `img` element.
    pub fn data_uri(&self) -> String {
        format!("data:{};base64,{}", self.kind, base64(&self.bytes))
    }
}

/// A smaller copy of an image, as JPEG. `None` for an image without pixels.
pub fn small(title: &str, rgb: &RgbImage) -> Option<Picture> {
    let (width, height) = rgb.dimensions();
    if width == 0 || height == 0 {
        return None;
    }
    let scale = f64::from(WIDTH.min(width)) / f64::from(width);
    let height = ((f64::from(height) * scale).round() as u32).max(1);
    let thumbnail = image::imageops::thumbnail(rgb, WIDTH.min(width), height);
    let mut bytes = Vec::new();
    let (width, height) = thumbnail.dimensions();
    let encoder = JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY);
    encoder.write_image(thumbnail.as_raw(), width, height, ExtendedColorType::Rgb8).ok()?;
    Some(Picture { title: format!("{title}, first image"), kind: "image/jpeg", bytes })
}

/// A sweep from above in the body frame, x upwards, colored by height, with a circle each 10 m.
pub fn top_view(points: &[SweepPoint], body_from_lidar: &Pose) -> Option<Picture> {
    // LiDARs are often tilted.
    let body_from_lidar = body_from_lidar.cast::<f32>();
    let in_body = |point: &SweepPoint| body_from_lidar * Point3::new(point.x, point.y, point.z);
    let points: Vec<Point3<f32>> = points.iter().map(in_body).collect();
    let of = |value: fn(&Point3<f32>) -> f32, share: usize| {
        let mut values: Vec<f32> = points.iter().map(value).filter(|value| value.is_finite()).collect();
        values.sort_by(f32::total_cmp);
        values.get(values.len().saturating_sub(1) * share / 100).copied()
    };
    let reach_m = of(|p| p.x.hypot(p.y), 95)?.clamp(REACH_M[0], REACH_M[1]);
    let lowest_m = of(|p| p.z, 5)?;
    let mut view = RgbImage::from_pixel(SIDE, SIDE, Rgb([18, 20, 26]));
    let scale = 0.5 * SIDE as f32 / reach_m;
    let place = |x: f32, y: f32| {
        let (u, v) = (0.5 * SIDE as f32 - y * scale, 0.5 * SIDE as f32 - x * scale);
        let is_inside = (0.0..SIDE as f32).contains(&u) && (0.0..SIDE as f32).contains(&v);
        is_inside.then_some((u as u32, v as u32))
    };
    for circle in 1..=(reach_m / 10.0) as u32 {
        for step in 0..2000_u16 {
            let (sin, cos) = (f32::from(step) / 2000.0 * std::f32::consts::TAU).sin_cos();
            let radius = circle as f32 * 10.0;
            if let Some((u, v)) = place(radius * cos, radius * sin) {
                view.put_pixel(u, v, Rgb([52, 56, 66]));
            }
        }
    }
    for point in &points {
        if let Some((u, v)) = place(point.x, point.y) {
            view.put_pixel(u, v, height_color((point.z - lowest_m) / HEIGHT_M));
        }
    }
    let mut bytes = Vec::new();
    view.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).ok()?;
    let title = format!("LiDAR, one sweep of {} returns from above; circles each 10 m, forward is up", points.len());
    Some(Picture { title, kind: "image/png", bytes })
}

/// Blue, green, yellow, red.
fn height_color(share: f32) -> Rgb<u8> {
    const STOPS: [[f32; 3]; 4] =
        [[70.0, 130.0, 255.0], [60.0, 220.0, 130.0], [250.0, 220.0, 80.0], [255.0, 90.0, 70.0]];
    let at = share.clamp(0.0, 1.0) * 3.0;
    let low = (at as usize).min(2);
    let mix = |k: usize| (STOPS[low][k] + (STOPS[low + 1][k] - STOPS[low][k]) * (at - low as f32)) as u8;
    Rgb([mix(0), mix(1), mix(2)])
}

/// The time of each sensor as a bar under the others, in seconds after the begin of the LiDAR; gaps are open.
pub fn timeline(streams: &[Stream], origin: Stamp) -> String {
    const ROW: f64 = 26.0;
    const LEFT: f64 = 270.0;
    const LENGTH: f64 = 580.0;
    let spans: Vec<(&Stream, [f64; 2])> = streams
        .iter()
        .filter_map(|stream| Some((stream, stream.span()?.map(|stamp| seconds_between(stamp, origin)))))
        .collect();
    let begin = spans.iter().map(|(_, span)| span[0]).fold(0.0, f64::min);
    let end = spans.iter().map(|(_, span)| span[1]).fold(0.0, f64::max);
    let seconds = (end - begin).max(1e-3);
    let x = |at: f64| LEFT + LENGTH * (at - begin) / seconds;
    let height = ROW * (spans.len() as f64 + 1.0);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"900\" height=\"{height}\" viewBox=\"0 0 900 {height}\" \
         font-family=\"sans-serif\" font-size=\"13\">\n"
    );
    for (row, (stream, [first, last])) in spans.iter().enumerate() {
        let y = ROW * row as f64;
        let name = chart::escaped(&stream.name);
        // Writing to a string cannot fail.
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{name}</text>", LEFT - 10.0, y + 17.0);
        let width = (x(*last) - x(*first)).max(1.0);
        let _ = writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"14\" fill=\"#0072b2\"/>",
            x(*first),
            y + 6.0
        );
        for gap in stream.gaps().listed {
            let at = seconds_between(gap.begin, origin);
            let width = (x(at + gap.seconds) - x(at)).max(1.0);
            let _ = writeln!(
                svg,
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{width:.1}\" height=\"14\" fill=\"#d55e00\"/>",
                x(at),
                y + 6.0
            );
        }
    }
    let y = height - 8.0;
    let _ = writeln!(svg, "<text x=\"{LEFT}\" y=\"{y:.1}\">{begin:.1} s</text>");
    let _ = writeln!(svg, "<text x=\"{}\" y=\"{y:.1}\" text-anchor=\"end\">{end:.1} s</text>", LEFT + LENGTH);
    svg + "</svg>\n"
}

/// RFC 4648. Written here: a dozen lines.
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let word = three.iter().fold(0_u32, |word, byte| word << 8 | u32::from(*byte)) << (8 * (3 - three.len()));
        for k in 0..4 {
            let letter = ALPHABET[(word >> (18 - 6 * k) & 63) as usize] as char;
            text.push(if k <= three.len() { letter } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_matches_the_examples_of_the_standard() {
        for (bytes, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
    }

    #[test]
    fn top_view_shows_points_at_their_place() {
        let at = |x: f32, y: f32| SweepPoint { x, y, ..SweepPoint::default() };
        let mut points = vec![at(5.0, 0.0); 100];
        points.push(at(f32::NAN, 1.0));
        let picture = top_view(&points, &Pose::identity()).expect("has points");
        let view = image::load_from_memory(&picture.bytes).expect("is a PNG").to_rgb8();
        // 5 of 15 m ahead: a third of the way from the middle to the top.
        let expected = Rgb([70, 130, 255]);
        assert_eq!(*view.get_pixel(SIDE / 2, SIDE / 2 - SIDE / 6), expected);
        assert_eq!(view.pixels().filter(|pixel| **pixel == expected).count(), 1);
        assert!(top_view(&[], &Pose::identity()).is_none());
    }
}
