//! Instruction sets: what `pulp` leaves open for the kernel, rows of bodies to columns of lanes and back.

use pulp::Simd;

/// Contacts of a group; a multiple of the lanes of every instruction set.
pub const GROUP: usize = 8;

/// An instruction set that holds `F64_LANES` bodies at a time.
pub trait Lanes: Simd {
    /// Row `l` of `F64_LANES` rows of four numbers becomes lane `l` of four columns.
    fn columns<'a>(self, row: impl Fn(usize) -> &'a [f64; 4]) -> [Self::f64s; 4];

    /// The inverse of [`Lanes::columns`]: hands row `l` to `store(l, row)`, in order.
    fn rows(self, columns: [Self::f64s; 4], store: impl FnMut(usize, [f64; 4]));
}

impl Lanes for pulp::Scalar {
    #[inline(always)]
    fn columns<'a>(self, row: impl Fn(usize) -> &'a [f64; 4]) -> [f64; 4] {
        *row(0)
    }

    #[inline(always)]
    fn rows(self, columns: [f64; 4], mut store: impl FnMut(usize, [f64; 4])) {
        store(0, columns);
    }
}

#[cfg(target_arch = "x86_64")]
impl Lanes for pulp::x86::V3 {
    #[inline(always)]
    fn columns<'a>(self, row: impl Fn(usize) -> &'a [f64; 4]) -> [Self::f64s; 4] {
        let avx = self.avx;
        let [r0, r1, r2, r3] = [0, 1, 2, 3].map(|l| pulp::cast(*row(l)));
        // x0 x1 z0 z1 / y0 y1 w0 w1 and the same of rows 2 and 3
        let (xz01, yw01) = (avx._mm256_unpacklo_pd(r0, r1), avx._mm256_unpackhi_pd(r0, r1));
        let (xz23, yw23) = (avx._mm256_unpacklo_pd(r2, r3), avx._mm256_unpackhi_pd(r2, r3));
        [
            pulp::cast(avx._mm256_permute2f128_pd::<0x20>(xz01, xz23)),
            pulp::cast(avx._mm256_permute2f128_pd::<0x20>(yw01, yw23)),
            pulp::cast(avx._mm256_permute2f128_pd::<0x31>(xz01, xz23)),
            pulp::cast(avx._mm256_permute2f128_pd::<0x31>(yw01, yw23)),
        ]
    }

    #[inline(always)]
    fn rows(self, columns: [Self::f64s; 4], mut store: impl FnMut(usize, [f64; 4])) {
        let avx = self.avx;
        let [x, y, z, w] = columns.map(|c| pulp::cast(c));
        let (xy02, xy13) = (avx._mm256_unpacklo_pd(x, y), avx._mm256_unpackhi_pd(x, y));
        let (zw02, zw13) = (avx._mm256_unpacklo_pd(z, w), avx._mm256_unpackhi_pd(z, w));
        store(0, pulp::cast(avx._mm256_permute2f128_pd::<0x20>(xy02, zw02)));
        store(1, pulp::cast(avx._mm256_permute2f128_pd::<0x20>(xy13, zw13)));
        store(2, pulp::cast(avx._mm256_permute2f128_pd::<0x31>(xy02, zw02)));
        store(3, pulp::cast(avx._mm256_permute2f128_pd::<0x31>(xy13, zw13)));
    }
}

#[cfg(target_arch = "aarch64")]
impl Lanes for pulp::aarch64::Neon {
    #[inline(always)]
    fn columns<'a>(self, row: impl Fn(usize) -> &'a [f64; 4]) -> [Self::f64s; 4] {
        let (r0, r1) = (row(0), row(1));
        [0, 1, 2, 3].map(|k| pulp::cast([r0[k], r1[k]]))
    }

    #[inline(always)]
    fn rows(self, columns: [Self::f64s; 4], mut store: impl FnMut(usize, [f64; 4])) {
        let pairs: [[f64; 2]; 4] = columns.map(|c| pulp::cast(c));
        store(0, pairs.map(|p| p[0]));
        store(1, pairs.map(|p| p[1]));
    }
}

/// Which instructions the sweeps use. All give the same bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instructions {
    /// The widest set of this machine.
    #[default]
    Widest,
    /// One contact after the other.
    Scalar,
}

/// Work that is compiled once per instruction set.
pub trait Work {
    type Output;
    fn run<S: Lanes>(self, simd: S) -> Self::Output;
}

impl Instructions {
    /// Runs `work` in the best version that is allowed and that this machine has.
    #[inline]
    pub fn run<W: Work>(self, work: W) -> W::Output {
        if self == Self::Widest {
            #[cfg(target_arch = "x86_64")]
            if let Some(simd) = pulp::x86::V3::try_new() {
                return simd.vectorize(#[inline(always)] || work.run(simd));
            }
            #[cfg(target_arch = "aarch64")]
            if let Some(simd) = pulp::aarch64::Neon::try_new() {
                return simd.vectorize(#[inline(always)] || work.run(simd));
            }
        }
        work.run(pulp::Scalar)
    }
}
