//! Images in tensors, and kernels as operations of candle.

use candle_core::{Device, Tensor};
use kernels::images::ops::{Convolution, MaxPool, Upsample};
use kernels::images::tensors::{FromBlocks, ToBlocks, read_image, size_of_image, zeros};
use kernels::images::{Border, Filter, LANES, Planes, Shape};
use random::Random;

const BORDERS: [Border; 2] = [Border::Circular, Border::Zero];

fn image(size: [usize; 3], border: Border, random: &mut Random) -> Planes {
    Planes::from_fn(size, border, |_, _, _| random.range(-1.0, 1.0))
}

#[test]
fn image_converts_to_order_of_pytorch_and_back() {
    let mut random = Random::new(3);
    for (channels, border) in [1, 16, 37].into_iter().flat_map(|channels| BORDERS.map(|border| (channels, border))) {
        let planes = image([channels, 3, 5], border, &mut random);
        let tensor = planes.to_tensor().expect("an image");
        assert_eq!(size_of_image(&tensor).expect("an image"), [3, 5]);
        let ordered = tensor.apply_op1_no_bwd(&FromBlocks { channels }).expect("an image");
        assert_eq!(ordered.dims(), [1, channels, 3, 5]);
        let values = ordered.squeeze(0).and_then(|values| values.to_vec3::<f32>()).expect("values");
        for (channel, of_channel) in values.iter().enumerate() {
            for (y, row) in of_channel.iter().enumerate() {
                let pixels = planes.row(channel / LANES, y).iter().map(|pixel| pixel[channel % LANES]);
                assert!(pixels.eq(row.iter().copied()), "channel {channel}, row {y}");
            }
        }
        let back = ordered.apply_op1_no_bwd(&ToBlocks { border }).expect("an image");
        assert_eq!(Planes::from_tensor(&back, channels).expect("an image"), planes);
    }
}

/// `relu` of candle after a convolution gives the bits of the rectifier of the kernel, as do a sum and a product.
#[test]
fn operations_of_candle_stand_between_kernels() {
    let mut random = Random::new(4);
    let shape = |rectify| Shape { kernel: [3, 3], stride_x: 1, in_channels: vec![5], out_channels: 20, rectify };
    let weights: Vec<f32> = (0..20 * 5 * 9).map(|_| random.range(-1.0, 1.0)).collect();
    let [plain, rectified] = [false, true].map(|rectify| Filter::new(shape(rectify), &weights, &[0.0; 20]));
    let source = image([5, 8, 12], Border::Circular, &mut random).to_tensor().expect("an image");
    let convolved = |filter: &Filter| {
        let out = zeros(20, 8, 12).expect("memory");
        out.inplace_op2(&source, &Convolution { filter, border: Border::Circular }).expect("fits");
        out
    };
    let values = |tensor: &Tensor| tensor.flatten_all().and_then(|values| values.to_vec1::<f32>()).expect("values");
    let by_candle = convolved(&plain).relu().expect("runs");
    assert_eq!(values(&by_candle), values(&convolved(&rectified)));
    let twice = (&by_candle + &by_candle).expect("runs");
    let pooled = zeros(20, 4, 6).expect("memory");
    pooled.inplace_op2(&twice, &MaxPool { factor: [2, 2], border: Border::Circular }).expect("fits");
    let expected = zeros(20, 4, 6).expect("memory");
    expected.inplace_op2(&by_candle, &MaxPool { factor: [2, 2], border: Border::Circular }).expect("fits");
    assert_eq!(values(&pooled), values(&(expected * 2.0).expect("runs")));
}

#[test]
fn tensors_of_wrong_size_are_refused() {
    let shape = Shape { kernel: [3, 3], stride_x: 2, in_channels: vec![5, 20], out_channels: 9, rectify: true };
    let filter = Filter::new(shape, &[0.0; 9 * 25 * 9], &[0.0; 9]);
    let border = Border::Circular;
    let convolution = Convolution { filter: &filter, border };
    let few = zeros(5, 4, 8).expect("memory");
    let many = zeros(20, 4, 8).expect("memory");
    let out = zeros(9, 4, 4);
    let out = out.expect("memory");
    let small = zeros(5, 4, 6).expect("memory");
    out.inplace_op3(&few, &many, &convolution).expect("shapes fit");
    assert!(out.inplace_op2(&few, &convolution).is_err(), "one source is missing");
    assert!(out.inplace_op3(&many, &few, &convolution).is_err(), "the sources are exchanged");
    assert!(out.inplace_op3(&small, &many, &convolution).is_err(), "the sources differ in size");
    assert!(few.inplace_op3(&small, &many, &convolution).is_err(), "the output is too large");
    let of_factor = |factor| out.inplace_op2(&few, &MaxPool { factor, border });
    of_factor([1, 2]).expect("shapes fit");
    assert!(of_factor([2, 2]).is_err(), "rows do not match");
    few.inplace_op2(&out, &Upsample { factor: [1, 2], border }).expect("shapes fit");
    assert!(few.inplace_op2(&out, &Upsample { factor: [1, 3], border }).is_err(), "columns do not match");
    assert!(many.inplace_op2(&out, &Upsample { factor: [1, 2], border }).is_err(), "blocks do not match");
    let narrow = zeros(5, 4, 1).expect("memory");
    assert!(narrow.inplace_op2(&few, &MaxPool { factor: [1, 8], border }).is_err(), "narrower than its border");

    let flat = Tensor::zeros(7, candle_core::DType::F32, &Device::Cpu).expect("memory");
    assert!(size_of_image(&flat).is_err() && out.inplace_op2(&flat, &MaxPool { factor: [1, 1], border }).is_err());
    assert!(read_image(&out, 17, |_| ()).is_err(), "17 channels have two blocks");
    assert!(read_image(&out.t().expect("a view"), 9, |_| ()).is_err(), "lanes are not last");
    let integers = out.to_dtype(candle_core::DType::U32).expect("converts");
    assert!(read_image(&integers, 9, |_| ()).is_err(), "integers");
    assert!(integers.inplace_op2(&few, &MaxPool { factor: [1, 2], border }).is_err(), "integers");
    assert!(
        flat.apply_op1_no_bwd(&ToBlocks { border }).is_err()
            && flat.apply_op1_no_bwd(&FromBlocks { channels: 7 }).is_err()
    );
}
