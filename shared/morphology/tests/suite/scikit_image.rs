//! Results of scikit-image for a part of a photograph are the reference (`lab/peers/morphology.py freeze`). All pixel types must
//! give equal results, because flat operators depend only on the order of values.

use morphology::{
    Connectivity, Element, Level, area_closing, area_opening, closing, connected_components, dilate, erode, h_maxima,
    opening, reconstruct_by_dilation, regional_maxima, regional_minima,
};
use ndarray::Array2;

fn image_of(shape: (usize, usize), hex: &str) -> Array2<u8> {
    let byte = |idx: usize| u8::from_str_radix(&hex[2 * idx..2 * idx + 2], 16).expect("hexadecimal");
    Array2::from_shape_vec(shape, (0..hex.len() / 2).map(byte).collect()).expect("one byte for every pixel")
}

fn element(text: &str) -> Element {
    let (kind, sizes) = text.split_once(':').expect("KIND:SIZES");
    let sizes: Vec<isize> = sizes.split(',').map(|size| size.parse().expect("a number")).collect();
    match kind {
        "rectangle" => Element::rectangle(sizes[0] as usize, sizes[1] as usize),
        "disc" => Element::disc(sizes[0] as usize),
        "line" => Element::line(sizes[0], sizes[1]),
        _ => panic!("unknown element {kind}"),
    }
}

/// Applies operators that support all pixel types to the mapped image; `None` for other operators.
fn apply_generic<T: Level>(
    photo: &Array2<u8>,
    [operator, argument]: [&str; 2],
    connectivity: Connectivity,
    map: impl Fn(u8) -> T,
) -> Option<Array2<T>> {
    let image = photo.mapv(&map);
    let area = || argument.parse().expect("an area");
    Some(match operator {
        "dilate" => dilate(&image, element(argument)),
        "erode" => erode(&image, element(argument)),
        "opening" => opening(&image, element(argument)),
        "closing" => closing(&image, element(argument)),
        "area_opening" => area_opening(&image, area(), connectivity),
        "area_closing" => area_closing(&image, area(), connectivity),
        "reconstruct_by_dilation" => {
            let by: u8 = argument.parse().expect("a height");
            reconstruct_by_dilation(&photo.mapv(|v| map(v.saturating_sub(by))), &image, connectivity)
        }
        _ => return None,
    })
}

#[test]
fn results_equal_scikit_image() {
    let mut lines = include_str!("scikit_image.txt").lines().map(|line| line.split(' ').collect::<Vec<_>>());
    let Some(["image", rows, cols, photo]) =
        lines.next().as_deref().map(|words| [words[0], words[1], words[2], words[3]])
    else {
        panic!("the first line is the image")
    };
    let shape = (rows.parse().expect("rows"), cols.parse().expect("columns"));
    let photo = image_of(shape, photo);
    let mut n = 0;
    for words in lines {
        let job @ [operator, argument] = [words[0], words[1]];
        let truth = image_of(shape, words[3]);
        let connectivity = if words[2] == "4" { Connectivity::Four } else { Connectivity::Eight };
        n += 1;
        if let Some(result) = apply_generic(&photo, job, connectivity, |v| v) {
            assert_eq!(result, truth, "{words:?}");
            let wide = |v: u8| u16::from(v) * 201;
            assert_eq!(apply_generic(&photo, job, connectivity, wide), Some(truth.mapv(wide)), "{words:?}");
            let real = |v: u8| f32::from(v) * 0.5 - 20.0;
            assert_eq!(apply_generic(&photo, job, connectivity, real), Some(truth.mapv(real)), "{words:?}");
            continue;
        }
        let result = match operator {
            "regional_maxima" => regional_maxima(&photo, connectivity).mapv(u8::from),
            "regional_minima" => regional_minima(&photo, connectivity).mapv(u8::from),
            "h_maxima" => h_maxima(&photo, argument.parse().expect("a height"), connectivity).mapv(u8::from),
            "components" => {
                let threshold: u8 = argument.parse().expect("a value");
                let labels = connected_components(&photo.mapv(|v| v > threshold), connectivity);
                labels.image.mapv(|label| label as u8)
            }
            _ => panic!("unknown operator {operator}"),
        };
        assert_eq!(result, truth, "{words:?}");
    }
    assert_eq!(n, 34, "results");
}
