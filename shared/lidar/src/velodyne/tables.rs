//! Calibration tables of the manufacturer, lasers in firing order.

#![allow(clippy::unreadable_literal, reason = "numbers are written as in the original tables, for comparison")]

use super::Laser;

/// A beam from the origin.
const fn beam(elevation_deg: f64) -> Laser {
    Laser { elevation_deg, azimuth_deg: 0.0, range_m: 0.0, up_m: 0.0, left_m: 0.0 }
}

/// A beam from above or below the origin; offset in mm.
const fn shifted(elevation_deg: f64, up_mm: f64) -> Laser {
    Laser { up_m: up_mm * 1e-3, ..beam(elevation_deg) }
}

/// A beam that looks to the left of the encoder angle; angles in deg.
const fn turned(elevation_deg: f64, azimuth_deg: f64) -> Laser {
    Laser { azimuth_deg, ..beam(elevation_deg) }
}

/// A line of an HDL-64E's db.xml: vertical and rotational correction in deg; distance correction, vertical and horizontal
/// offset in cm.
const fn corrected(elevation_deg: f64, azimuth_deg: f64, range_cm: f64, up_cm: f64, left_cm: f64) -> Laser {
    Laser { elevation_deg, azimuth_deg, range_m: range_cm * 1e-2, up_m: up_cm * 1e-2, left_m: left_cm * 1e-2 }
}

/// HDL-32E.xml: two interleaved halves in steps of 4/3 deg, rounded to two decimals as in the file.
#[rustfmt::skip]
pub(super) static HDL32E: [Laser; 32] = [
    beam(-30.67), beam(-9.33), beam(-29.33), beam(-8.0), beam(-28.0), beam(-6.67), beam(-26.67), beam(-5.33),
    beam(-25.33), beam(-4.0), beam(-24.0), beam(-2.67), beam(-22.67), beam(-1.33), beam(-21.33), beam(0.0),
    beam(-20.0), beam(1.33), beam(-18.67), beam(2.67), beam(-17.33), beam(4.0), beam(-16.0), beam(5.33),
    beam(-14.67), beam(6.67), beam(-13.33), beam(8.0), beam(-12.0), beam(9.33), beam(-10.67), beam(10.67),
];

/// Angles of VLP-16.xml, vertical offsets of the manual 63-9243, table 9-1.
#[rustfmt::skip]
pub(super) static VLP16: [Laser; 16] = [
    shifted(-15.0, 11.2), shifted(1.0, -0.7), shifted(-13.0, 9.7), shifted(3.0, -2.2),
    shifted(-11.0, 8.1), shifted(5.0, -3.7), shifted(-9.0, 6.6), shifted(7.0, -5.1),
    shifted(-7.0, 5.1), shifted(9.0, -6.6), shifted(-5.0, 3.7), shifted(11.0, -8.1),
    shifted(-3.0, 2.2), shifted(13.0, -9.7), shifted(-1.0, 0.7), shifted(15.0, -11.2),
];

/// Elevations and azimuth offsets that all units share (the manufacturer's VLP32 calibration file, rounded to 0.001 deg).
#[rustfmt::skip]
pub(super) static VLP32C: [Laser; 32] = [
    turned(-25.0, -1.4), turned(-1.0, 4.2), turned(-1.667, -1.4), turned(-15.639, 1.4),
    turned(-11.31, -1.4), turned(0.0, 1.4), turned(-0.667, -4.2), turned(-8.843, 1.4),
    turned(-7.254, -1.4), turned(0.333, 4.2), turned(-0.333, -1.4), turned(-6.148, 1.4),
    turned(-5.333, -4.2), turned(1.333, 1.4), turned(0.667, -4.2), turned(-4.0, 1.4),
    turned(-4.667, -1.4), turned(1.667, 4.2), turned(1.0, -1.4), turned(-3.667, 4.2),
    turned(-3.333, -4.2), turned(3.333, 1.4), turned(2.333, -1.4), turned(-2.667, 1.4),
    turned(-3.0, -1.4), turned(7.0, 1.4), turned(4.667, -1.4), turned(-2.333, 4.2),
    turned(-2.0, -4.2), turned(15.0, 1.4), turned(10.333, -1.4), turned(-1.333, 1.4),
];

/// The db.xml of one HDL-64E. Every device has its own table, so other devices have errors of a few centimetres. Near-range corrections
/// along x and y are omitted.
#[rustfmt::skip]
pub(super) static HDL64E: [Laser; 64] = [
    corrected(-7.2988362, -5.3328056, 111.0, 19.736338, 2.6),
    corrected(-6.9644198, -3.2344019, 146.0, 19.778963, -2.6),
    corrected(0.250889, 2.4376695, 131.76823, 20.688799, 2.6),
    corrected(0.55538797, 4.7373252, 138.12656, 20.727015, -2.6),
    corrected(-6.6410818, -1.0502493, 119.0, 19.82012, 2.6),
    corrected(-6.2594609, 1.2386309, 135.0, 19.868624, -2.6),
    corrected(-8.6656351, -1.8405367, 132.0, 19.561426, 2.6),
    corrected(-8.3104696, 0.4511103, 145.0, 19.606993, -2.6),
    corrected(-5.9352221, 3.2611551, 116.0, 19.909781, 2.6),
    corrected(-5.587399, 5.4685535, 133.99889, 19.953875, -2.6),
    corrected(-7.9891219, 2.4743285, 117.0, 19.648148, 2.6),
    corrected(-7.644258, 4.7189918, 145.0, 19.692244, -2.6),
    corrected(-3.2475569, -5.3511744, 118.71672, 20.249313, 2.6),
    corrected(-2.850472, -3.1158857, 142.90839, 20.29929, -2.6),
    corrected(-5.204318, -6.1270261, 120.0, 20.00238, 2.6),
    corrected(-4.9137921, -3.852011, 137.0, 20.039125, -2.6),
    corrected(-2.4998751, -1.1109436, 101.71324, 20.343384, 2.6),
    corrected(-2.184176, 1.1519098, 145.31258, 20.38307, -2.6),
    corrected(-4.5764661, -1.8682934, 130.0, 20.081753, 2.6),
    corrected(-4.2038751, 0.43604341, 147.0, 20.128786, -2.6),
    corrected(-1.798143, 3.1763444, 115.82812, 20.431576, 2.6),
    corrected(-1.49388, 5.4284201, 146.0, 20.469791, -2.6),
    corrected(-1.877563, 2.4024715, 129.29713, 20.169943, 2.6),
    corrected(-3.492661, 4.6698937, 157.97737, 20.218447, -2.6),
    corrected(0.88327599, -5.3977456, 124.12312, 20.768169, 2.6),
    corrected(1.234519, -3.1504908, 128.0, 20.812265, -2.6),
    corrected(-1.177825, -6.1759849, 133.0, 20.509478, 2.6),
    corrected(-0.86169797, -3.8819003, 130.0, 20.549164, -2.6),
    corrected(1.585669, -1.1136208, 131.0, 20.856361, 2.6),
    corrected(1.925001, 1.0969903, 131.0, 20.898987, -2.6),
    corrected(-0.486963, -1.9088749, 138.48773, 20.596197, 2.6),
    corrected(-0.123898, 0.36758029, 137.21994, 20.641764, -2.6),
    corrected(-22.597513, -8.3386211, 117.0, 10.828748, 2.6),
    corrected(-22.397568, -4.7629819, 100.0, 10.854152, -2.6),
    corrected(-11.576517, 4.1516571, 130.0, 12.142142, 2.6),
    corrected(-10.877901, 7.3577185, 102.0, 12.220895, -2.6),
    corrected(-21.935509, -1.2630961, 106.0, 10.912581, 2.6),
    corrected(-21.409546, 2.1595552, 91.0, 10.978632, -2.6),
    corrected(-25.066507, -2.6141083, 127.0, 10.508655, 2.6),
    corrected(-24.458101, 0.95595688, 95.0, 10.588678, -2.6),
    corrected(-20.777454, 5.5369682, 106.0, 11.057385, 2.6),
    corrected(-20.243195, 8.9712191, 97.0, 11.123436, -2.6),
    corrected(-23.863358, 4.4757471, 115.0, 10.666161, 2.6),
    corrected(-23.352007, 7.8848143, 92.0, 10.732212, -2.6),
    corrected(-16.629311, -8.0466499, 135.0, 11.559117, 2.6),
    corrected(-16.230633, -4.595552, 108.0, 11.606115, -2.6),
    corrected(-19.788239, -9.3918352, 135.0, 11.179325, 2.6),
    corrected(-19.21587, -5.9566336, 98.0, 11.249186, -2.6),
    corrected(-15.754419, -1.3779737, 116.0, 11.662004, 2.6),
    corrected(-15.166914, 2.0754263, 105.0, 11.730595, -2.6),
    corrected(-18.828558, -2.5654242, 138.0, 11.296184, 2.6),
    corrected(-18.312876, 0.87227631, 105.0, 11.358424, -2.6),
    corrected(-14.641928, 5.2989287, 123.0, 11.791565, 2.6),
    corrected(-14.048302, 8.7970304, 86.0, 11.860156, -2.6),
    corrected(-17.687857, 4.1742177, 135.0, 11.433367, 2.6),
    corrected(-17.16544, 7.5869775, 92.0, 11.495607, -2.6),
    corrected(-10.436752, -7.8831077, 121.0, 12.270433, 2.6),
    corrected(-10.085198, -4.5919614, 103.0, 12.30981, -2.6),
    corrected(-13.484814, -9.1805763, 146.0, 11.924937, 2.6),
    corrected(-13.107666, -5.7835727, 99.0, 11.968124, -2.6),
    corrected(-9.5621262, -1.2335371, 123.0, 12.368239, 2.6),
    corrected(-9.0374413, 1.9424959, 106.0, 12.426669, -2.6),
    corrected(-12.651329, -2.5727935, 134.0, 12.020203, 2.6),
    corrected(-12.115005, 0.81118912, 104.0, 12.081173, -2.6),
];
