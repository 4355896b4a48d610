//! The problems of W. Hock and K. Schittkowski, Test Examples for Nonlinear Programming Codes,
//! Lecture Notes in Economics and Mathematical Systems 187, Springer, 1981, that are used here,
//! with their numbers, starting points and optimal values.

use super::{Formulas, Number};
use std::f64::consts::{PI, SQRT_2};

const INF: f64 = f64::INFINITY;
const SQRT_3: f64 = 1.732_050_807_568_877_2;
/// At least zero.
const GE: (f64, f64) = (0.0, INF);
/// Equal to zero.
const EQ: (f64, f64) = (0.0, 0.0);

pub struct Hs1;

impl Formulas for Hs1 {
    const NAME: &'static str = "HS1";
    const OPTIMUM: f64 = 0.0;
    fn start() -> Vec<f64> {
        vec![-2.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-INF, INF), (-1.5, INF)]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[1] - x[0].powi(2)).powi(2) * 100.0 + (x[0] - 1.0).powi(2)
    }
}

pub struct Hs2;

impl Formulas for Hs2 {
    const NAME: &'static str = "HS2";
    const OTHER_MINIMA: &'static [f64] = &[4.941_229_318];
    const OPTIMUM: f64 = 0.050_426_187_9;
    fn start() -> Vec<f64> {
        vec![-2.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-INF, INF), (1.5, INF)]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[1] - x[0].powi(2)).powi(2) * 100.0 + (x[0] - 1.0).powi(2)
    }
}

pub struct Hs3;

impl Formulas for Hs3 {
    const NAME: &'static str = "HS3";
    const OPTIMUM: f64 = 0.0;
    fn start() -> Vec<f64> {
        vec![10.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-INF, INF), (0.0, INF)]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[1] + (x[1] - x[0]).powi(2) * 1e-5
    }
}

pub struct Hs4;

impl Formulas for Hs4 {
    const NAME: &'static str = "HS4";
    const OPTIMUM: f64 = 8.0 / 3.0;
    fn start() -> Vec<f64> {
        vec![1.125, 0.125]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(1.0, INF), (0.0, INF)]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] + 1.0).powi(3) / 3.0 + x[1]
    }
}

pub struct Hs5;

impl Formulas for Hs5 {
    const NAME: &'static str = "HS5";
    const OPTIMUM: f64 = -1.913_222_954_981_037;
    fn start() -> Vec<f64> {
        vec![0.0, 0.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-1.5, 4.0), (-3.0, 3.0)]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] + x[1]).sin() + (x[0] - x[1]).powi(2) - x[0] * 1.5 + x[1] * 2.5 + 1.0
    }
}

pub struct Hs6;

impl Formulas for Hs6 {
    const NAME: &'static str = "HS6";
    const OPTIMUM: f64 = 0.0;
    fn start() -> Vec<f64> {
        vec![-1.2, 1.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 1.0).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![(x[1] - x[0].powi(2)) * 10.0]
    }
}

pub struct Hs7;

impl Formulas for Hs7 {
    const NAME: &'static str = "HS7";
    const OPTIMUM: f64 = -1.732_050_807_568_877_2;
    fn start() -> Vec<f64> {
        vec![2.0, 2.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0].powi(2) + 1.0).ln() - x[1]
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![(x[0].powi(2) + 1.0).powi(2) + x[1].powi(2) - 4.0]
    }
}

pub struct Hs8;

impl Formulas for Hs8 {
    const NAME: &'static str = "HS8";
    const OPTIMUM: f64 = -1.0;
    fn start() -> Vec<f64> {
        vec![2.0, 1.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0] * 0.0 - 1.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0].powi(2) + x[1].powi(2) - 25.0, x[0] * x[1] - 9.0]
    }
}

pub struct Hs9;

impl Formulas for Hs9 {
    const NAME: &'static str = "HS9";
    const OPTIMUM: f64 = -0.5;
    fn start() -> Vec<f64> {
        vec![0.0, 0.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] * (PI / 12.0)).sin() * (x[1] * (PI / 16.0)).cos()
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0] * 4.0 - x[1] * 3.0]
    }
}

pub struct Hs10;

impl Formulas for Hs10 {
    const NAME: &'static str = "HS10";
    const OPTIMUM: f64 = -1.0;
    fn start() -> Vec<f64> {
        vec![-10.0, 10.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0] - x[1]
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0].powi(2) * -3.0 + x[0] * x[1] * 2.0 - x[1].powi(2) + 1.0]
    }
}

pub struct Hs11;

impl Formulas for Hs11 {
    const NAME: &'static str = "HS11";
    const OPTIMUM: f64 = -8.498_464_223;
    fn start() -> Vec<f64> {
        vec![4.9, 0.1]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 5.0).powi(2) + x[1].powi(2) - 25.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[1] - x[0].powi(2)]
    }
}

pub struct Hs12;

impl Formulas for Hs12 {
    const NAME: &'static str = "HS12";
    const OPTIMUM: f64 = -30.0;
    fn start() -> Vec<f64> {
        vec![0.0, 0.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0].powi(2) * 0.5 + x[1].powi(2) - x[0] * x[1] - x[0] * 7.0 - x[1] * 7.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![-x[0].powi(2) * 4.0 - x[1].powi(2) + 25.0]
    }
}

pub struct Hs14;

impl Formulas for Hs14 {
    const NAME: &'static str = "HS14";
    const OPTIMUM: f64 = 1.393_464_98;
    fn start() -> Vec<f64> {
        vec![2.0, 2.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 2.0).powi(2) + (x[1] - 1.0).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            -x[0].powi(2) / 4.0 - x[1].powi(2) + 1.0,
            x[0] - x[1] * 2.0 + 1.0,
        ]
    }
}

pub struct Hs15;

impl Formulas for Hs15 {
    const NAME: &'static str = "HS15";
    const OTHER_MINIMA: &'static [f64] = &[360.379_767_23];
    const OPTIMUM: f64 = 306.5;
    fn start() -> Vec<f64> {
        vec![-2.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-INF, 0.5), (-INF, INF)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[1] - x[0].powi(2)).powi(2) * 100.0 + (x[0] - 1.0).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0] * x[1] - 1.0, x[0] + x[1].powi(2)]
    }
}

pub struct Hs16;

impl Formulas for Hs16 {
    const NAME: &'static str = "HS16";
    const OTHER_MINIMA: &'static [f64] = &[3.982_060_45];
    const OPTIMUM: f64 = 0.25;
    fn start() -> Vec<f64> {
        vec![-2.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-2.0, 0.5), (-INF, 1.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[1] - x[0].powi(2)).powi(2) * 100.0 + (x[0] - 1.0).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0] + x[1].powi(2), x[0].powi(2) + x[1]]
    }
}

pub struct Hs17;

impl Formulas for Hs17 {
    const NAME: &'static str = "HS17";
    const OPTIMUM: f64 = 1.0;
    fn start() -> Vec<f64> {
        vec![-2.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-2.0, 0.5), (-INF, 1.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[1] - x[0].powi(2)).powi(2) * 100.0 + (x[0] - 1.0).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[1].powi(2) - x[0], x[0].powi(2) - x[1]]
    }
}

pub struct Hs18;

impl Formulas for Hs18 {
    const NAME: &'static str = "HS18";
    const OPTIMUM: f64 = 5.0;
    fn start() -> Vec<f64> {
        vec![2.0, 2.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(2.0, 50.0), (0.0, 50.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0].powi(2) * 0.01 + x[1].powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0] * x[1] - 25.0, x[0].powi(2) + x[1].powi(2) - 25.0]
    }
}

pub struct Hs19;

impl Formulas for Hs19 {
    const NAME: &'static str = "HS19";
    const OPTIMUM: f64 = -6_961.813_875_6;
    fn start() -> Vec<f64> {
        vec![20.1, 5.84]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(13.0, 100.0), (0.0, 100.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 10.0).powi(3) + (x[1] - 20.0).powi(3)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            (x[0] - 5.0).powi(2) + (x[1] - 5.0).powi(2) - 100.0,
            -(x[1] - 5.0).powi(2) - (x[0] - 6.0).powi(2) + 82.81,
        ]
    }
}

pub struct Hs20;

impl Formulas for Hs20 {
    const NAME: &'static str = "HS20";
    const OTHER_MINIMA: &'static [f64] = &[40.198_729_81];
    const OPTIMUM: f64 = 38.198_729_81;
    fn start() -> Vec<f64> {
        vec![-2.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-0.5, 0.5), (-INF, INF)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[1] - x[0].powi(2)).powi(2) * 100.0 + (x[0] - 1.0).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0] + x[1].powi(2),
            x[0].powi(2) + x[1],
            x[0].powi(2) + x[1].powi(2) - 1.0,
        ]
    }
}

pub struct Hs22;

impl Formulas for Hs22 {
    const NAME: &'static str = "HS22";
    const OPTIMUM: f64 = 1.0;
    fn start() -> Vec<f64> {
        vec![2.0, 2.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 2.0).powi(2) + (x[1] - 1.0).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![-x[0] - x[1] + 2.0, x[1] - x[0].powi(2)]
    }
}

pub struct Hs23;

impl Formulas for Hs23 {
    const NAME: &'static str = "HS23";
    const OPTIMUM: f64 = 2.0;
    fn start() -> Vec<f64> {
        vec![3.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-50.0, 50.0), (-50.0, 50.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE, GE, GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0].powi(2) + x[1].powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0] + x[1] - 1.0,
            x[0].powi(2) + x[1].powi(2) - 1.0,
            x[0].powi(2) * 9.0 + x[1].powi(2) - 9.0,
            x[0].powi(2) - x[1],
            x[1].powi(2) - x[0],
        ]
    }
}

pub struct Hs24;

impl Formulas for Hs24 {
    const NAME: &'static str = "HS24";
    const OPTIMUM: f64 = -1.0;
    fn start() -> Vec<f64> {
        vec![1.0, 0.5]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(0.0, INF), (0.0, INF)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        ((x[0] - 3.0).powi(2) - 9.0) * x[1].powi(3) / (27.0 * SQRT_3)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0] / SQRT_3 - x[1],
            x[0] + x[1] * SQRT_3,
            -x[0] - x[1] * SQRT_3 + 6.0,
        ]
    }
}

pub struct Hs26;

impl Formulas for Hs26 {
    const NAME: &'static str = "HS26";
    const OPTIMUM: f64 = 0.0;
    fn start() -> Vec<f64> {
        vec![-2.6, 2.0, 2.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - x[1]).powi(2) + (x[1] - x[2]).powi(4)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![(x[1].powi(2) + 1.0) * x[0] + x[2].powi(4) - 3.0]
    }
}

pub struct Hs27;

impl Formulas for Hs27 {
    const NAME: &'static str = "HS27";
    const OPTIMUM: f64 = 0.04;
    fn start() -> Vec<f64> {
        vec![2.0, 2.0, 2.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 1.0).powi(2) * 0.01 + (x[1] - x[0].powi(2)).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0] + x[2].powi(2) + 1.0]
    }
}

pub struct Hs28;

impl Formulas for Hs28 {
    const NAME: &'static str = "HS28";
    const OPTIMUM: f64 = 0.0;
    fn start() -> Vec<f64> {
        vec![-4.0, 1.0, 1.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] + x[1]).powi(2) + (x[1] + x[2]).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0] + x[1] * 2.0 + x[2] * 3.0 - 1.0]
    }
}

pub struct Hs29;

impl Formulas for Hs29 {
    const NAME: &'static str = "HS29";
    const OPTIMUM: f64 = -22.627_416_997_969_52;
    fn start() -> Vec<f64> {
        vec![1.0, 1.0, 1.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        -x[0] * x[1] * x[2]
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![-x[0].powi(2) - x[1].powi(2) * 2.0 - x[2].powi(2) * 4.0 + 48.0]
    }
}

pub struct Hs30;

impl Formulas for Hs30 {
    const NAME: &'static str = "HS30";
    const OPTIMUM: f64 = 1.0;
    fn start() -> Vec<f64> {
        vec![1.0, 1.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(1.0, 10.0), (-10.0, 10.0), (-10.0, 10.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0].powi(2) + x[1].powi(2) + x[2].powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0].powi(2) + x[1].powi(2) - 1.0]
    }
}

pub struct Hs31;

impl Formulas for Hs31 {
    const NAME: &'static str = "HS31";
    const OPTIMUM: f64 = 6.0;
    fn start() -> Vec<f64> {
        vec![1.0, 1.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-10.0, 10.0), (1.0, 10.0), (-10.0, 1.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0].powi(2) * 9.0 + x[1].powi(2) + x[2].powi(2) * 9.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0] * x[1] - 1.0]
    }
}

pub struct Hs32;

impl Formulas for Hs32 {
    const NAME: &'static str = "HS32";
    const OPTIMUM: f64 = 1.0;
    fn start() -> Vec<f64> {
        vec![0.1, 0.7, 0.2]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(0.0, INF), (0.0, INF), (0.0, INF)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] + x[1] * 3.0 + x[2]).powi(2) + (x[0] - x[1]).powi(2) * 4.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[1] * 6.0 + x[2] * 4.0 - x[0].powi(3) - 3.0,
            -x[0] - x[1] - x[2] + 1.0,
        ]
    }
}

pub struct Hs33;

impl Formulas for Hs33 {
    const NAME: &'static str = "HS33";
    const OTHER_MINIMA: &'static [f64] = &[-4.0];
    const OPTIMUM: f64 = -4.585_786_437_626_905;
    fn start() -> Vec<f64> {
        vec![0.0, 0.0, 3.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(0.0, INF), (0.0, INF), (0.0, 5.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 1.0) * (x[0] - 2.0) * (x[0] - 3.0) + x[2]
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[2].powi(2) - x[1].powi(2) - x[0].powi(2),
            x[0].powi(2) + x[1].powi(2) + x[2].powi(2) - 4.0,
        ]
    }
}

pub struct Hs34;

impl Formulas for Hs34 {
    const NAME: &'static str = "HS34";
    const OPTIMUM: f64 = -0.834_032_445_247_956_3;
    fn start() -> Vec<f64> {
        vec![0.0, 1.05, 2.9]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(0.0, 100.0), (0.0, 100.0), (0.0, 10.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        -x[0]
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[1] - x[0].exp(), x[2] - x[1].exp()]
    }
}

pub struct Hs36;

impl Formulas for Hs36 {
    const NAME: &'static str = "HS36";
    const OPTIMUM: f64 = -3_300.0;
    fn start() -> Vec<f64> {
        vec![10.0, 10.0, 10.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(0.0, 20.0), (0.0, 11.0), (0.0, 42.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        -x[0] * x[1] * x[2]
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![-x[0] - x[1] * 2.0 - x[2] * 2.0 + 72.0]
    }
}

pub struct Hs37;

impl Formulas for Hs37 {
    const NAME: &'static str = "HS37";
    const OPTIMUM: f64 = -3_456.0;
    fn start() -> Vec<f64> {
        vec![10.0, 10.0, 10.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(0.0, 42.0), (0.0, 42.0), (0.0, 42.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        -x[0] * x[1] * x[2]
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            -x[0] - x[1] * 2.0 - x[2] * 2.0 + 72.0,
            x[0] + x[1] * 2.0 + x[2] * 2.0,
        ]
    }
}

pub struct Hs38;

impl Formulas for Hs38 {
    const NAME: &'static str = "HS38";
    const OPTIMUM: f64 = 0.0;
    fn start() -> Vec<f64> {
        vec![-3.0, -1.0, -3.0, -1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-10.0, 10.0), (-10.0, 10.0), (-10.0, 10.0), (-10.0, 10.0)]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[1] - x[0].powi(2)).powi(2) * 100.0
            + (x[0] - 1.0).powi(2)
            + (x[3] - x[2].powi(2)).powi(2) * 90.0
            + (x[2] - 1.0).powi(2)
            + ((x[1] - 1.0).powi(2) + (x[3] - 1.0).powi(2)) * 10.1
            + (x[1] - 1.0) * (x[3] - 1.0) * 19.8
    }
}

pub struct Hs39;

impl Formulas for Hs39 {
    const NAME: &'static str = "HS39";
    const OPTIMUM: f64 = -1.0;
    fn start() -> Vec<f64> {
        vec![2.0, 2.0, 2.0, 2.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        -x[0]
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[1] - x[0].powi(3) - x[2].powi(2),
            x[0].powi(2) - x[1] - x[3].powi(2),
        ]
    }
}

pub struct Hs40;

impl Formulas for Hs40 {
    const NAME: &'static str = "HS40";
    const OPTIMUM: f64 = -0.25;
    fn start() -> Vec<f64> {
        vec![0.8, 0.8, 0.8, 0.8]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        -x[0] * x[1] * x[2] * x[3]
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0].powi(3) + x[1].powi(2) - 1.0,
            x[0].powi(2) * x[3] - x[2],
            x[3].powi(2) - x[1],
        ]
    }
}

pub struct Hs41;

impl Formulas for Hs41 {
    const NAME: &'static str = "HS41";
    const OPTIMUM: f64 = 52.0 / 27.0;
    fn start() -> Vec<f64> {
        vec![2.0, 2.0, 2.0, 2.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(0.0, 1.0), (0.0, 1.0), (0.0, 1.0), (0.0, 2.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        -x[0] * x[1] * x[2] + 2.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0] + x[1] * 2.0 + x[2] * 2.0 - x[3]]
    }
}

pub struct Hs42;

impl Formulas for Hs42 {
    const NAME: &'static str = "HS42";
    const OPTIMUM: f64 = 13.857_864_376_269_049;
    fn start() -> Vec<f64> {
        vec![1.0, 1.0, 1.0, 1.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 1.0).powi(2) + (x[1] - 2.0).powi(2) + (x[2] - 3.0).powi(2) + (x[3] - 4.0).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0] - 2.0, x[2].powi(2) + x[3].powi(2) - 2.0]
    }
}

pub struct Hs43;

impl Formulas for Hs43 {
    const NAME: &'static str = "HS43";
    const OPTIMUM: f64 = -44.0;
    fn start() -> Vec<f64> {
        vec![0.0, 0.0, 0.0, 0.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0].powi(2) + x[1].powi(2) + x[2].powi(2) * 2.0 + x[3].powi(2)
            - x[0] * 5.0
            - x[1] * 5.0
            - x[2] * 21.0
            + x[3] * 7.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            -x[0].powi(2) - x[1].powi(2) - x[2].powi(2) - x[3].powi(2) - x[0] + x[1] - x[2]
                + x[3]
                + 8.0,
            -x[0].powi(2) - x[1].powi(2) * 2.0 - x[2].powi(2) - x[3].powi(2) * 2.0
                + x[0]
                + x[3]
                + 10.0,
            -x[0].powi(2) * 2.0 - x[1].powi(2) - x[2].powi(2) - x[0] * 2.0 + x[1] + x[3] + 5.0,
        ]
    }
}

pub struct Hs48;

impl Formulas for Hs48 {
    const NAME: &'static str = "HS48";
    const OPTIMUM: f64 = 0.0;
    fn start() -> Vec<f64> {
        vec![3.0, 5.0, -3.0, 2.0, -2.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 1.0).powi(2) + (x[1] - x[2]).powi(2) + (x[3] - x[4]).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0] + x[1] + x[2] + x[3] + x[4] - 5.0,
            x[2] - (x[3] + x[4]) * 2.0 + 3.0,
        ]
    }
}

pub struct Hs60;

impl Formulas for Hs60 {
    const NAME: &'static str = "HS60";
    const OPTIMUM: f64 = 0.032_568_200_25;
    fn start() -> Vec<f64> {
        vec![2.0, 2.0, 2.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-10.0, 10.0), (-10.0, 10.0), (-10.0, 10.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 1.0).powi(2) + (x[0] - x[1]).powi(2) + (x[1] - x[2]).powi(4)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[0] * (x[1].powi(2) + 1.0) + x[2].powi(4) - 4.0 - 3.0 * SQRT_2]
    }
}

pub struct Hs61;

impl Formulas for Hs61 {
    const NAME: &'static str = "HS61";
    const OPTIMUM: f64 = -143.646_142_201;
    fn start() -> Vec<f64> {
        vec![0.0, 0.0, 0.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0].powi(2) * 4.0 + x[1].powi(2) * 2.0 + x[2].powi(2) * 2.0 - x[0] * 33.0 + x[1] * 16.0
            - x[2] * 24.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0] * 3.0 - x[1].powi(2) * 2.0 - 7.0,
            x[0] * 4.0 - x[2].powi(2) - 11.0,
        ]
    }
}

pub struct Hs63;

impl Formulas for Hs63 {
    const NAME: &'static str = "HS63";
    const OPTIMUM: f64 = 961.715_172_1;
    fn start() -> Vec<f64> {
        vec![2.0, 2.0, 2.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(0.0, INF), (0.0, INF), (0.0, INF)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        -x[0].powi(2) - x[1].powi(2) * 2.0 - x[2].powi(2) - x[0] * x[1] - x[0] * x[2] + 1_000.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0] * 8.0 + x[1] * 14.0 + x[2] * 7.0 - 56.0,
            x[0].powi(2) + x[1].powi(2) + x[2].powi(2) - 25.0,
        ]
    }
}

pub struct Hs65;

impl Formulas for Hs65 {
    const NAME: &'static str = "HS65";
    const OPTIMUM: f64 = 0.953_528_856_7;
    fn start() -> Vec<f64> {
        vec![-5.0, 5.0, 0.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(-4.5, 4.5), (-4.5, 4.5), (-5.0, 5.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - x[1]).powi(2) + (x[0] + x[1] - 10.0).powi(2) / 9.0 + (x[2] - 5.0).powi(2)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![-x[0].powi(2) - x[1].powi(2) - x[2].powi(2) + 48.0]
    }
}

pub struct Hs66;

impl Formulas for Hs66 {
    const NAME: &'static str = "HS66";
    const OPTIMUM: f64 = 0.518_163_274_1;
    fn start() -> Vec<f64> {
        vec![0.0, 1.05, 2.9]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(0.0, 100.0), (0.0, 100.0), (0.0, 10.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[2] * 0.2 - x[0] * 0.8
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![x[1] - x[0].exp(), x[2] - x[1].exp()]
    }
}

pub struct Hs71;

impl Formulas for Hs71 {
    const NAME: &'static str = "HS71";
    const OPTIMUM: f64 = 17.014_017_289;
    fn start() -> Vec<f64> {
        vec![1.0, 5.0, 5.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(1.0, 5.0), (1.0, 5.0), (1.0, 5.0), (1.0, 5.0)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2]
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0] * x[1] * x[2] * x[3] - 25.0,
            x[0].powi(2) + x[1].powi(2) + x[2].powi(2) + x[3].powi(2) - 40.0,
        ]
    }
}

pub struct Hs72;

impl Formulas for Hs72 {
    const NAME: &'static str = "HS72";
    const OPTIMUM: f64 = 727.679_37;
    fn start() -> Vec<f64> {
        vec![1.0, 1.0, 1.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(0.001, 4e5), (0.001, 3e5), (0.001, 2e5), (0.001, 1e5)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0] + x[1] + x[2] + x[3] + 1.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            -(x[0].recip() * 4.0 + x[1].recip() * 2.25 + x[2].recip() + x[3].recip() * 0.25)
                + 0.0401,
            -(x[0].recip() * 0.16
                + x[1].recip() * 0.36
                + x[2].recip() * 0.64
                + x[3].recip() * 0.64)
                + 0.010_085,
        ]
    }
}

pub struct Hs73;

impl Formulas for Hs73 {
    const NAME: &'static str = "HS73";
    const OPTIMUM: f64 = 29.894_378_16;
    fn start() -> Vec<f64> {
        vec![1.0, 1.0, 1.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![(0.0, INF), (0.0, INF), (0.0, INF), (0.0, INF)]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0] * 24.55 + x[1] * 26.75 + x[2] * 39.0 + x[3] * 40.5
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0] * 2.3 + x[1] * 5.6 + x[2] * 11.1 + x[3] * 1.3 - 5.0,
            x[0] * 12.0 + x[1] * 11.9 + x[2] * 41.8 + x[3] * 52.1
                - 21.0
                - (x[0].powi(2) * 0.28
                    + x[1].powi(2) * 0.19
                    + x[2].powi(2) * 20.5
                    + x[3].powi(2) * 0.62)
                    .sqrt()
                    * 1.645,
            x[0] + x[1] + x[2] + x[3] - 1.0,
        ]
    }
}

pub struct Hs77;

impl Formulas for Hs77 {
    const NAME: &'static str = "HS77";
    const OPTIMUM: f64 = 0.241_505_13;
    fn start() -> Vec<f64> {
        vec![2.0, 2.0, 2.0, 2.0, 2.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 1.0).powi(2)
            + (x[0] - x[1]).powi(2)
            + (x[2] - 1.0).powi(2)
            + (x[3] - 1.0).powi(4)
            + (x[4] - 1.0).powi(6)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0].powi(2) * x[3] + (x[3] - x[4]).sin() - 2.0 * SQRT_2,
            x[1] + x[2].powi(4) * x[3].powi(2) - 8.0 - SQRT_2,
        ]
    }
}

pub struct Hs78;

impl Formulas for Hs78 {
    const NAME: &'static str = "HS78";
    const OPTIMUM: f64 = -2.919_700_41;
    fn start() -> Vec<f64> {
        vec![-2.0, 1.5, 2.0, -1.0, -1.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0] * x[1] * x[2] * x[3] * x[4]
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0].powi(2) + x[1].powi(2) + x[2].powi(2) + x[3].powi(2) + x[4].powi(2) - 10.0,
            x[1] * x[2] - x[3] * x[4] * 5.0,
            x[0].powi(3) + x[1].powi(3) + 1.0,
        ]
    }
}

pub struct Hs79;

impl Formulas for Hs79 {
    const NAME: &'static str = "HS79";
    const OPTIMUM: f64 = 0.078_776_820_9;
    fn start() -> Vec<f64> {
        vec![2.0, 2.0, 2.0, 2.0, 2.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 1.0).powi(2)
            + (x[0] - x[1]).powi(2)
            + (x[1] - x[2]).powi(2)
            + (x[2] - x[3]).powi(4)
            + (x[3] - x[4]).powi(4)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0] + x[1].powi(2) + x[2].powi(3) - 2.0 - 3.0 * SQRT_2,
            x[1] - x[2].powi(2) + x[3] + 2.0 - 2.0 * SQRT_2,
            x[0] * x[4] - 2.0,
        ]
    }
}

pub struct Hs80;

impl Formulas for Hs80 {
    const NAME: &'static str = "HS80";
    const OPTIMUM: f64 = 0.053_949_847_8;
    fn start() -> Vec<f64> {
        vec![-2.0, 2.0, 2.0, -1.0, -1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![
            (-2.3, 2.3),
            (-2.3, 2.3),
            (-3.2, 3.2),
            (-3.2, 3.2),
            (-3.2, 3.2),
        ]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] * x[1] * x[2] * x[3] * x[4]).exp()
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0].powi(2) + x[1].powi(2) + x[2].powi(2) + x[3].powi(2) + x[4].powi(2) - 10.0,
            x[1] * x[2] - x[3] * x[4] * 5.0,
            x[0].powi(3) + x[1].powi(3) + 1.0,
        ]
    }
}

pub struct Hs81;

impl Formulas for Hs81 {
    const NAME: &'static str = "HS81";
    const OPTIMUM: f64 = 0.053_949_847_8;
    fn start() -> Vec<f64> {
        vec![-2.0, 2.0, 2.0, -1.0, -1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![
            (-2.3, 2.3),
            (-2.3, 2.3),
            (-3.2, 3.2),
            (-3.2, 3.2),
            (-3.2, 3.2),
        ]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![EQ, EQ, EQ]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] * x[1] * x[2] * x[3] * x[4]).exp() - (x[0].powi(3) + x[1].powi(3) + 1.0).powi(2) * 0.5
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0].powi(2) + x[1].powi(2) + x[2].powi(2) + x[3].powi(2) + x[4].powi(2) - 10.0,
            x[1] * x[2] - x[3] * x[4] * 5.0,
            x[0].powi(3) + x[1].powi(3) + 1.0,
        ]
    }
}

pub struct Hs93;

impl Formulas for Hs93 {
    const NAME: &'static str = "HS93";
    const OPTIMUM: f64 = 135.075_961;
    fn start() -> Vec<f64> {
        vec![5.54, 4.4, 12.02, 11.82, 0.702, 0.852]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![
            (0.0, INF),
            (0.0, INF),
            (0.0, INF),
            (0.0, INF),
            (0.0, INF),
            (0.0, INF),
        ]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0] * x[3] * (x[0] + x[1] + x[2]) * (x[4].powi(2) * 0.0607 + 0.0204)
            + x[1] * x[2] * (x[0] + x[1] * 1.57 + x[3]) * (x[5].powi(2) * 0.0437 + 0.0187)
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            x[0] * x[1] * x[2] * x[3] * x[4] * x[5] * 0.001 - 2.07,
            -x[0] * x[3] * x[4].powi(2) * (x[0] + x[1] + x[2]) * 0.000_62
                - x[1] * x[2] * x[5].powi(2) * (x[0] + x[1] * 1.57 + x[3]) * 0.000_58
                + 1.0,
        ]
    }
}

pub struct Hs100;

impl Formulas for Hs100 {
    const NAME: &'static str = "HS100";
    const OPTIMUM: f64 = 680.630_057_3;
    fn start() -> Vec<f64> {
        vec![1.0, 2.0, 0.0, 4.0, 0.0, 1.0, 1.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE, GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] - 10.0).powi(2)
            + (x[1] - 12.0).powi(2) * 5.0
            + x[2].powi(4)
            + (x[3] - 11.0).powi(2) * 3.0
            + x[4].powi(6) * 10.0
            + x[5].powi(2) * 7.0
            + x[6].powi(4)
            - x[5] * x[6] * 4.0
            - x[5] * 10.0
            - x[6] * 8.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            -x[0].powi(2) * 2.0 - x[1].powi(4) * 3.0 - x[2] - x[3].powi(2) * 4.0 - x[4] * 5.0
                + 127.0,
            -x[0] * 7.0 - x[1] * 3.0 - x[2].powi(2) * 10.0 - x[3] + x[4] + 282.0,
            -x[0] * 23.0 - x[1].powi(2) - x[5].powi(2) * 6.0 + x[6] * 8.0 + 196.0,
            -x[0].powi(2) * 4.0 - x[1].powi(2) + x[0] * x[1] * 3.0
                - x[2].powi(2) * 2.0
                - x[5] * 5.0
                + x[6] * 11.0,
        ]
    }
}

pub struct Hs108;

impl Formulas for Hs108 {
    const NAME: &'static str = "HS108";
    const OTHER_MINIMA: &'static [f64] = &[-0.674_981_429_3, -0.5];
    const OPTIMUM: f64 = -0.866_025_403_784_438_6;
    fn start() -> Vec<f64> {
        vec![1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
    }
    fn bounds() -> Vec<(f64, f64)> {
        vec![
            (-INF, INF),
            (-INF, INF),
            (-INF, INF),
            (-INF, INF),
            (-INF, INF),
            (-INF, INF),
            (-INF, INF),
            (-INF, INF),
            (0.0, INF),
        ]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE, GE, GE, GE, GE, GE, GE, GE, GE, GE, GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        (x[0] * x[3] - x[1] * x[2] + x[2] * x[8] - x[4] * x[8] + x[4] * x[7] - x[5] * x[6]) * -0.5
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            -x[2].powi(2) - x[3].powi(2) + 1.0,
            -x[8].powi(2) + 1.0,
            -x[4].powi(2) - x[5].powi(2) + 1.0,
            -x[0].powi(2) - (x[1] - x[8]).powi(2) + 1.0,
            -(x[0] - x[4]).powi(2) - (x[1] - x[5]).powi(2) + 1.0,
            -(x[0] - x[6]).powi(2) - (x[1] - x[7]).powi(2) + 1.0,
            -(x[2] - x[4]).powi(2) - (x[3] - x[5]).powi(2) + 1.0,
            -(x[2] - x[6]).powi(2) - (x[3] - x[7]).powi(2) + 1.0,
            -x[6].powi(2) - (x[7] - x[8]).powi(2) + 1.0,
            x[0] * x[3] - x[1] * x[2],
            x[2] * x[8],
            -x[4] * x[8],
            x[4] * x[7] - x[5] * x[6],
        ]
    }
}

pub struct Hs113;

impl Formulas for Hs113 {
    const NAME: &'static str = "HS113";
    const OPTIMUM: f64 = 24.306_209_1;
    fn start() -> Vec<f64> {
        vec![2.0, 3.0, 5.0, 5.0, 1.0, 2.0, 7.0, 3.0, 6.0, 10.0]
    }
    fn ranges() -> Vec<(f64, f64)> {
        vec![GE, GE, GE, GE, GE, GE, GE, GE]
    }
    fn objective<D: Number>(x: &[D]) -> D {
        x[0].powi(2) + x[1].powi(2) + x[0] * x[1] - x[0] * 14.0 - x[1] * 16.0
            + (x[2] - 10.0).powi(2)
            + (x[3] - 5.0).powi(2) * 4.0
            + (x[4] - 3.0).powi(2)
            + (x[5] - 1.0).powi(2) * 2.0
            + x[6].powi(2) * 5.0
            + (x[7] - 11.0).powi(2) * 7.0
            + (x[8] - 10.0).powi(2) * 2.0
            + (x[9] - 7.0).powi(2)
            + 45.0
    }
    fn constraints<D: Number>(x: &[D]) -> Vec<D> {
        vec![
            -x[0] * 4.0 - x[1] * 5.0 + x[6] * 3.0 - x[7] * 9.0 + 105.0,
            -x[0] * 10.0 + x[1] * 8.0 + x[6] * 17.0 - x[7] * 2.0,
            x[0] * 8.0 - x[1] * 2.0 - x[8] * 5.0 + x[9] * 2.0 + 12.0,
            -(x[0] - 2.0).powi(2) * 3.0 - (x[1] - 3.0).powi(2) * 4.0 - x[2].powi(2) * 2.0
                + x[3] * 7.0
                + 120.0,
            -x[0].powi(2) * 5.0 - x[1] * 8.0 - (x[2] - 6.0).powi(2) + x[3] * 2.0 + 40.0,
            -(x[0] - 8.0).powi(2) * 0.5 - (x[1] - 4.0).powi(2) * 2.0 - x[4].powi(2) * 3.0
                + x[5]
                + 30.0,
            -x[0].powi(2) - (x[1] - 2.0).powi(2) * 2.0 + x[0] * x[1] * 2.0 - x[4] * 14.0
                + x[5] * 6.0,
            x[0] * 3.0 - x[1] * 6.0 - (x[8] - 8.0).powi(2) * 12.0 + x[9] * 7.0,
        ]
    }
}

/// Calls a macro or function with every problem.
macro_rules! for_each_problem {
    ($visit:ident) => {
        $visit!(
            Hs1, Hs2, Hs3, Hs4, Hs5, Hs6, Hs7, Hs8, Hs9, Hs10, Hs11, Hs12, Hs14, Hs15, Hs16, Hs17,
            Hs18, Hs19, Hs20, Hs22, Hs23, Hs24, Hs26, Hs27, Hs28, Hs29, Hs30, Hs31, Hs32, Hs33,
            Hs34, Hs36, Hs37, Hs38, Hs39, Hs40, Hs41, Hs42, Hs43, Hs48, Hs60, Hs61, Hs63, Hs65,
            Hs66, Hs71, Hs72, Hs73, Hs77, Hs78, Hs79, Hs80, Hs81, Hs93, Hs100, Hs108, Hs113
        )
    };
}
pub(crate) use for_each_problem;
