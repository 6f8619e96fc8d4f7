//! Phase functions: how scattered light spreads over the sphere. Twin of `render/march/phase.wesl`.
//!
//! Values are in 1/sr and integrate to 1 over the sphere. `cos_theta` is the cosine between the direction from the camera and
//! the direction to the sun, in −1..=1: +1 looks at the sun (the silver lining).

use std::f64::consts::PI;

use crate::settings::{CloudLighting, CloudPhase, PhaseFunction, SettingsError};

/// Least and greatest droplet diameter (µm) for which Jendersie & d'Eon give [`HgDraine`].
pub const DROPLET_DIAMETERS: std::ops::RangeInclusive<f64> = 5.0..=50.0;

/// 1/4π: no direction is preferred.
pub fn isotropic() -> f64 {
    0.25 / PI
}

/// Henyey–Greenstein (Ford 3.11): `(1 − g²) / (4π (1 + g² − 2g cosθ)^1.5)`, asymmetry `g` in −1..1.
pub fn hg(g: f64, cos_theta: f64) -> f64 {
    (1.0 - g * g) / (4.0 * PI * (1.0 + g * g - 2.0 * g * cos_theta).powf(1.5))
}

/// Draine (Ford 3.12): `HG(g) · (1 + α cos²θ) / (1 + α (1 + 2g²) / 3)`, asymmetry `g` in −1..1 and `alpha` ≥ 0.
///
/// `alpha` = 0 is Henyey–Greenstein, 1 is Cornette–Shanks, and 1 with `g` = 0 is Rayleigh.
pub fn draine(g: f64, alpha: f64, cos_theta: f64) -> f64 {
    hg(g, cos_theta) * (1.0 + alpha * cos_theta * cos_theta) / (1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0)
}

/// `3 (1 + cos²θ) / 16π` (Costa 2.10 and Harris lack the 1/4π).
pub fn rayleigh(cos_theta: f64) -> f64 {
    draine(0.0, 1.0, cos_theta)
}

/// Cornette–Shanks, `3 (1 − g²)(1 + cos²θ) / (8π (2 + g²)(1 + g² − 2g cosθ)^1.5)` (Högfeldt 5.5 lacks 1/4π).
pub fn cornette_shanks(g: f64, cos_theta: f64) -> f64 {
    draine(g, 1.0, cos_theta)
}

/// Schlick, `(1 − k²) / (4π (1 − k cosθ)²)`, `k` in −1..1.
pub fn schlick(k: f64, cos_theta: f64) -> f64 {
    (1.0 - k * k) / (4.0 * PI * (1.0 - k * cos_theta).powi(2))
}

/// Schlick's k that stands for Henyey–Greenstein's g: `1.55g − 0.55g³`. It passes 1 at g = 0.94, and is held at 0.999.
pub fn schlick_k(g: f64) -> f64 {
    (1.55 * g - 0.55 * g.powi(3)).clamp(-0.999, 0.999)
}

/// `(1 − mix)·HG(g) + mix·HG(g_back)`, with `mix` in 0..=1.
pub fn two_lobe(g: f64, g_back: f64, mix: f64, cos_theta: f64) -> f64 {
    (1.0 - mix) * hg(g, cos_theta) + mix * hg(g_back, cos_theta)
}

/// Parameters of the fit to Mie scattering by water droplets (Jendersie & d'Eon; Ford 3.13).
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct HgDraine {
    /// Asymmetry of the narrow Henyey–Greenstein lobe (0..1).
    pub g_hg: f64,
    /// Asymmetry of the broad Draine lobe (0..1).
    pub g_d: f64,
    /// Draine's α (0 or more).
    pub alpha: f64,
    /// Share of the Draine lobe (0..=1).
    pub w: f64,
}

impl HgDraine {
    /// The fit for droplets of this diameter (µm).
    ///
    /// Ford 3.14 to 3.17, whose signs and last constant are misprinted, as Jendersie & d'Eon have them (equations 4
    /// to 7): `g_HG = e^(−0.0990567/(d−1.67154))`, `g_D = e^(−2.20679/(d+3.91029) − 0.428934)`,
    /// `α = e^(3.62489 − 8.29288/(d+5.52825))`, `w = e^(−0.599085/(d−0.641583) − 0.665888)`.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] outside [`DROPLET_DIAMETERS`].
    pub fn from_diameter(d: f64) -> Result<Self, SettingsError> {
        if !DROPLET_DIAMETERS.contains(&d) {
            return Err(SettingsError::OutOfRange {
                field: "lighting.droplet_diameter".to_owned(),
                value: d.to_string(),
                min: DROPLET_DIAMETERS.start().to_string(),
                max: DROPLET_DIAMETERS.end().to_string(),
            });
        }
        Ok(Self {
            g_hg: (-0.0990567 / (d - 1.67154)).exp(),
            g_d: (-2.20679 / (d + 3.91029) - 0.428934).exp(),
            alpha: (3.62489 - 8.29288 / (d + 5.52825)).exp(),
            w: (-0.599085 / (d - 0.641583) - 0.665888).exp(),
        })
    }

    /// `(1 − w)·HG(g_HG) + w·Draine(g_D, α)` (Ford 3.13; his program gives `w` to the wrong lobe).
    pub fn value(&self, cos_theta: f64) -> f64 {
        (1.0 - self.w) * hg(self.g_hg, cos_theta) + self.w * draine(self.g_d, self.alpha, cos_theta)
    }
}

/// Mean cosine of [`draine`] (Draine 2003, equation 6).
fn draine_mean_cosine(g: f64, alpha: f64) -> f64 {
    g * (1.0 + alpha * (3.0 + 2.0 * g * g) / 5.0) / (1.0 + alpha * (1.0 + 2.0 * g * g) / 3.0)
}

/// A phase function with its parameters.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Phase {
    /// [`isotropic`].
    Isotropic,
    /// [`hg`].
    HenyeyGreenstein {
        /// Asymmetry (−1..1).
        g: f64,
    },
    /// [`two_lobe`].
    TwoLobe {
        /// Asymmetry of the first lobe (−1..1).
        g: f64,
        /// Asymmetry of the second lobe (−1..1).
        g_back: f64,
        /// Share of the second lobe (0..=1).
        mix: f64,
    },
    /// [`HgDraine::value`].
    HgDraine(HgDraine),
    /// [`rayleigh`].
    Rayleigh,
    /// [`cornette_shanks`].
    CornetteShanks {
        /// Asymmetry (−1..1).
        g: f64,
    },
    /// [`schlick`].
    Schlick {
        /// Schlick's k (−1..1).
        k: f64,
    },
}

impl Phase {
    /// The phase function that these settings choose.
    ///
    /// # Errors
    /// [`SettingsError::OutOfRange`] where [`PhaseFunction::HgDraine`] is chosen and the droplet diameter is outside
    /// [`DROPLET_DIAMETERS`].
    pub fn from_settings(lighting: &CloudLighting) -> Result<Self, SettingsError> {
        Self::of(&lighting.into())
    }

    /// The phase function of a layer. For those that are tables it is what stands in for them until they are there:
    /// see [`PhaseFunction`].
    ///
    /// # Errors
    /// As [`from_settings`](Self::from_settings).
    pub fn of(phase: &CloudPhase) -> Result<Self, SettingsError> {
        let g = f64::from(phase.g);
        Ok(match phase.function {
            PhaseFunction::Isotropic => Self::Isotropic,
            PhaseFunction::Rayleigh => Self::Rayleigh,
            PhaseFunction::HenyeyGreenstein => Self::HenyeyGreenstein { g },
            PhaseFunction::CornetteShanks => Self::CornetteShanks { g },
            PhaseFunction::Schlick => Self::Schlick { k: schlick_k(g) },
            PhaseFunction::TwoLobe => Self::TwoLobe { g, g_back: phase.g_back.into(), mix: phase.lobe_mix.into() },
            PhaseFunction::HgDraine | PhaseFunction::Mie => {
                Self::HgDraine(HgDraine::from_diameter(phase.droplet_diameter.into())?)
            }
            PhaseFunction::Ice => Self::HgDraine(super::ice::stand_in()),
            PhaseFunction::Table => Self::HenyeyGreenstein { g },
        })
    }

    /// The phase value (1/sr). `eccentricity` (0..=1) multiplies every asymmetry, and Draine's α: it is cⁱ in octave i
    /// of the multiple-scattering sum (Ford 3.8 and 3.9; Wrenninge), so that late octaves become isotropic.
    pub fn value(&self, cos_theta: f64, eccentricity: f64) -> f64 {
        let c = eccentricity;
        match *self {
            Self::Isotropic => isotropic(),
            Self::HenyeyGreenstein { g } => hg(c * g, cos_theta),
            Self::TwoLobe { g, g_back, mix } => two_lobe(c * g, c * g_back, mix, cos_theta),
            Self::HgDraine(HgDraine { g_hg, g_d, alpha, w }) => {
                HgDraine { g_hg: c * g_hg, g_d: c * g_d, alpha: c * alpha, w }.value(cos_theta)
            }
            Self::Rayleigh => draine(0.0, c, cos_theta),
            Self::CornetteShanks { g } => draine(c * g, c, cos_theta),
            Self::Schlick { k } => schlick(c * k, cos_theta),
        }
    }

    /// Mean cosine ⟨cosθ⟩ of the scattering angle.
    pub fn mean_cosine(&self) -> f64 {
        match *self {
            Self::Isotropic => 0.0,
            Self::HenyeyGreenstein { g } => g,
            Self::TwoLobe { g, g_back, mix } => (1.0 - mix) * g + mix * g_back,
            Self::HgDraine(HgDraine { g_hg, g_d, alpha, w }) => (1.0 - w) * g_hg + w * draine_mean_cosine(g_d, alpha),
            Self::Rayleigh => 0.0,
            Self::CornetteShanks { g } => draine_mean_cosine(g, 1.0),
            // The closed form below cancels near 0, where the mean is ⅔k.
            Self::Schlick { k } if k.abs() < 1e-3 => 2.0 / 3.0 * k,
            Self::Schlick { k } => 1.0 / k - (1.0 - k * k) / (2.0 * k * k) * ((1.0 + k) / (1.0 - k)).ln(),
        }
    }

    /// Share of the light that a forward peak of a degree or so takes, and that hardly turns: 0 where there is none.
    pub fn peak_share(&self) -> f64 {
        match self {
            Self::HgDraine(droplets) => 1.0 - droplets.w,
            _ => 0.0,
        }
    }

    /// Mean cosine of that peak's light: 0 where there is none.
    pub fn peak_asymmetry(&self) -> f64 {
        match self {
            Self::HgDraine(droplets) => droplets.g_hg,
            _ => 0.0,
        }
    }

    /// `kind` and `params` of the shader's `phase()`.
    pub fn shader_parameters(&self) -> (u32, [f32; 4]) {
        let (kind, params) = match *self {
            Self::Isotropic => (0, [0.0; 4]),
            Self::HenyeyGreenstein { g } => (1, [g, 0.0, 0.0, 0.0]),
            Self::TwoLobe { g, g_back, mix } => (2, [g, g_back, mix, 0.0]),
            Self::HgDraine(HgDraine { g_hg, g_d, alpha, w }) => (3, [g_hg, g_d, alpha, w]),
            Self::Rayleigh => (4, [0.0; 4]),
            Self::CornetteShanks { g } => (5, [g, 0.0, 0.0, 0.0]),
            Self::Schlick { k } => (6, [k, 0.0, 0.0, 0.0]),
        };
        (kind, params.map(|p| p as f32))
    }
}
