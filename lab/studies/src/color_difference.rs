//! Perceived color differences: CIE76 in CIELAB, from sRGB under D65 (IEC 61966-2-1, CIE 15).

/// Distance of two colors; 2.3 is just noticeable.
pub fn difference(a: [u8; 3], b: [u8; 3]) -> f64 {
    let a = lab(a);
    let b = lab(b);
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// L* (0 to 100), a*, b*.
fn lab(color: [u8; 3]) -> [f64; 3] {
    let [r, g, b] = color.map(|level| {
        let level = f64::from(level) / 255.0;
        if level <= 0.040_45 { level / 12.92 } else { ((level + 0.055) / 1.055).powf(2.4) }
    });
    // Rows divided by the white of D65.
    let x = (0.412_4 * r + 0.357_6 * g + 0.180_5 * b) / 0.950_5;
    let y = 0.212_6 * r + 0.715_2 * g + 0.072_2 * b;
    let z = (0.019_3 * r + 0.119_2 * g + 0.950_5 * b) / 1.089;
    let root = |t: f64| if t > 216.0 / 24_389.0 { t.cbrt() } else { (24_389.0 / 27.0 * t + 16.0) / 116.0 };
    let [x, y, z] = [x, y, z].map(root);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}
