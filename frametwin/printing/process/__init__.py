"""How struts behave while they are printed: material, weight and hardening."""
