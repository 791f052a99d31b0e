//! Elastic and viscous material: stress and its derivatives with respect to the deformation gradient (thesis 4.5.1).

use nalgebra::{Matrix3, Vector3};

/// Neo-Hookean material with viscosity. The energy density is Ψ = μ/2 (tr FᵀF − 3) − μ ln J + λ/4 (J² − 1) − λ/2 ln J. Rigid
/// rotation causes no viscous stress.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Density at rest, kg/m³.
    pub density_kg_m3: f64,
    /// Lamé parameter μ, the shear modulus, Pa.
    pub mu_pa: f64,
    /// Lamé parameter λ, Pa.
    pub lambda_pa: f64,
    /// Viscosity η, Pa·s. The viscous stress is 2 η F D, with the rate of Green's strain D = (ḞᵀF + FᵀḞ)/2. The value is 32
    /// times the ν in the thesis's tables.
    pub viscosity_pa_s: f64,
}

/// Stress of a deformation, with terms for its derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stress {
    material: Material,
    deformation: Matrix3<f64>,
    rate: Matrix3<f64>,
    inverse: Matrix3<f64>,
    /// Relative growth J² − 1.
    growth: f64,
    /// Squared volume ratio J².
    squared: f64,
    strain_rate: Matrix3<f64>,
}

impl Material {
    /// Creates a material without viscosity from Young's modulus, Pa, and Poisson's ratio.
    pub fn elastic(density_kg_m3: f64, young_pa: f64, poisson: f64) -> Self {
        Self {
            density_kg_m3,
            mu_pa: 0.5 * young_pa / (1.0 + poisson),
            lambda_pa: young_pa * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
            viscosity_pa_s: 0.0,
        }
    }

    /// Energy density of a deformation gradient, J/m³; NaN if the gradient is inverted.
    pub(super) fn energy_density(&self, deformation: &Matrix3<f64>) -> f64 {
        let volume = deformation.determinant();
        let &Self { mu_pa, lambda_pa, .. } = self;
        0.5 * mu_pa * (deformation.norm_squared() - 3.0)
            + 0.25 * lambda_pa * (volume * volume - 1.0)
            - (mu_pa + 0.5 * lambda_pa) * volume.ln()
    }
}

impl Stress {
    /// Computes the stress of a deformation gradient F and its rate Ḟ, 1/s. Returns `None` if F is inverted.
    pub fn new(
        material: &Material,
        deformation: &Matrix3<f64>,
        rate: &Matrix3<f64>,
    ) -> Option<Self> {
        let volume = deformation.determinant();
        if volume.is_nan() || volume <= 0.0 {
            return None;
        }
        let half = deformation.transpose() * rate;
        Some(Self {
            material: *material,
            deformation: *deformation,
            rate: *rate,
            inverse: deformation.try_inverse()?.transpose(),
            growth: volume * volume - 1.0,
            squared: volume * volume,
            strain_rate: (half + half.transpose()) * 0.5,
        })
    }

    /// First Piola–Kirchhoff stress μ (F − F⁻ᵀ) + λ/2 (J² − 1) F⁻ᵀ + 2 η F D, Pa.
    pub fn value(&self) -> Matrix3<f64> {
        let Material { mu_pa, lambda_pa, viscosity_pa_s, .. } = self.material;
        (self.deformation - self.inverse) * mu_pa
            + self.inverse * (0.5 * lambda_pa * self.growth)
            + self.deformation * self.strain_rate * (2.0 * viscosity_pa_s)
    }

    /// Derivatives of the traction P a with respect to the vectors x and ẋ, Pa, where F = … + x bᵀ and Ḟ = … + ẋ bᵀ. If a and b
    /// are gradients of the shape functions of two nodes, this is the effect of one node's motion on the force on the other.
    // Without inlining, a step of a soft body takes a tenth longer.
    #[inline(always)]
    pub fn derivatives(&self, a: &Vector3<f64>, b: &Vector3<f64>) -> [Matrix3<f64>; 2] {
        let Material { mu_pa, lambda_pa, viscosity_pa_s, .. } = self.material;
        let (ab, one) = (a.dot(b), Matrix3::identity());
        let (inverse_a, inverse_b) = (self.inverse * a, self.inverse * b);
        let elastic = one * (mu_pa * ab)
            + inverse_b * inverse_a.transpose() * (mu_pa - 0.5 * lambda_pa * self.growth)
            + inverse_a * inverse_b.transpose() * (lambda_pa * self.squared);
        let (f, f_rate) = (&self.deformation, &self.rate);
        let (moved_a, moved_b) = (f * a, f * b);
        // δ(F D a) = δF D a + F (δFᵀḞ + ḞᵀδF) a / 2, and likewise with respect to Ḟ.
        let by_place = one * b.dot(&(self.strain_rate * a))
            + (f * f_rate.transpose() * ab + moved_b * (f_rate * a).transpose()) * 0.5;
        let by_rate = (f * f.transpose() * ab + moved_b * moved_a.transpose()) * 0.5;
        [elastic + by_place * (2.0 * viscosity_pa_s), by_rate * (2.0 * viscosity_pa_s)]
    }
}
