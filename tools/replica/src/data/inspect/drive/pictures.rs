//! Small pictures for the page: images of cameras, and the first sweep from above.

use super::stream::{Gap, Stream, seconds_between};
use chart::{BarRow, COLORS};
use geometry::{Point3, Pose, Stamp};
use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageFormat, Rgb, RgbImage};
use lidar::SweepPoint;
use std::io::Cursor;

/// Width of a picture of a camera on a page, px.
pub const WIDTH: u32 = 480;
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
    /// The bytes of its file.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    /// The picture as the address of an `img` element.
    pub fn data_uri(&self) -> String {
        page::data_uri(self.kind, &self.bytes)
    }
}

/// A smaller copy of an image, as JPEG. `None` for an image without pixels.
pub fn small(title: &str, rgb: &RgbImage) -> Option<Picture> {
    jpeg(format!("{title}, first image"), &thumbnail(rgb, WIDTH)?)
}

/// A copy of an image, at most `max_width` px wide. `None` for an image without pixels.
pub fn thumbnail(rgb: &RgbImage, max_width: u32) -> Option<RgbImage> {
    let (width, height) = rgb.dimensions();
    if width == 0 || height == 0 {
        return None;
    }
    let scale = f64::from(max_width.min(width)) / f64::from(width);
    let height = ((f64::from(height) * scale).round() as u32).max(1);
    Some(image::imageops::thumbnail(rgb, max_width.min(width), height))
}

/// An image as JPEG.
pub fn jpeg(title: String, rgb: &RgbImage) -> Option<Picture> {
    let mut bytes = Vec::new();
    let (width, height) = rgb.dimensions();
    let encoder = JpegEncoder::new_with_quality(&mut bytes, JPEG_QUALITY);
    encoder.write_image(rgb.as_raw(), width, height, ExtendedColorType::Rgb8).ok()?;
    Some(Picture { title, kind: "image/jpeg", bytes })
}

/// An image as PNG.
pub fn png(title: String, rgb: &RgbImage) -> Option<Picture> {
    let mut bytes = Vec::new();
    rgb.write_to(&mut Cursor::new(&mut bytes), ImageFormat::Png).ok()?;
    Some(Picture { title, kind: "image/png", bytes })
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
        let u = 0.5 * SIDE as f32 - y * scale;
        let v = 0.5 * SIDE as f32 - x * scale;
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
    png(format!("LiDAR, one sweep of {} returns from above; circles each 10 m, forward is up", points.len()), &view)
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

/// Timeline with one bar per sensor, in seconds after the start of the LiDAR; gaps are orange.
pub fn timeline(streams: &[Stream], origin: Stamp) -> String {
    let spans: Vec<(&Stream, [f64; 2])> = streams
        .iter()
        .filter_map(|stream| Some((stream, stream.span()?.map(|stamp| seconds_between(stamp, origin)))))
        .collect();
    let begin = spans.iter().map(|(_, span)| span[0]).fold(0.0, f64::min);
    let end = spans.iter().map(|(_, span)| span[1]).fold(0.0, f64::max);
    let rows: Vec<BarRow> = spans
        .iter()
        .map(|(stream, span)| {
            let gap = |gap: &Gap| {
                let from = seconds_between(gap.begin, origin);
                ([from, from + gap.seconds], COLORS[1].to_owned())
            };
            let mut pieces = vec![(*span, COLORS[0].to_owned())];
            pieces.extend(stream.gaps().listed.iter().map(gap));
            BarRow { name: stream.name.clone(), pieces, text: String::new() }
        })
        .collect();
    chart::bars(&rows, [begin, end.max(begin + 1e-3)], [&format!("{begin:.1} s"), &format!("{end:.1} s")])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn top_view_shows_points_at_their_place() {
        let at = |x: f32, y: f32| SweepPoint { x, y, ..SweepPoint::default() };
        let mut points = vec![at(5.0, 0.0); 100];
        points.push(at(f32::NAN, 1.0));
        let picture = top_view(&points, &Pose::identity()).expect("has points");
        let view = image::load_from_memory(&picture.bytes).expect("is a PNG").to_rgb8();
        // 5 of 15 m ahead: a third of the distance from the middle to the top.
        let expected = Rgb([70, 130, 255]);
        assert_eq!(*view.get_pixel(SIDE / 2, SIDE / 2 - SIDE / 6), expected);
        assert_eq!(view.pixels().filter(|pixel| **pixel == expected).count(), 1);
        assert!(top_view(&[], &Pose::identity()).is_none());
    }
}
