use image::{GrayImage, RgbImage};
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let files = &a[3..];
    let cols: u32 = a[2].parse().unwrap();
    let ims: Vec<RgbImage> = files
        .iter()
        .map(|f| {
            if f.ends_with("pgm") {
                let b = std::fs::read(f).unwrap();
                let (w, h) = (2048u32, 1088u32);
                let off = b.len() - (w * h * 2) as usize;
                let px: Vec<u8> =
                    b[off..].chunks_exact(2).map(|c| (u16::from_be_bytes([c[0], c[1]]) / 4) as u8).collect();
                let g = GrayImage::from_raw(w, h, px).unwrap();
                image::DynamicImage::ImageLuma8(g).to_rgb8()
            } else {
                image::open(f).unwrap().to_rgb8()
            }
        })
        .collect();
    let (w, h) = ims[0].dimensions();
    let rows = (ims.len() as u32).div_ceil(cols);
    let mut out = RgbImage::new(w * cols, h * rows);
    for (i, m) in ims.iter().enumerate() {
        image::imageops::replace(&mut out, m, (i as u32 % cols * w) as i64, (i as u32 / cols * h) as i64);
    }
    out.save(&a[1]).unwrap();
}
