"""The proving ground of vibration: true structures by Runge–Kutta, linear simulations by their exact solution."""
