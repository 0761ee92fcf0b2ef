"""What a photograph is good for, told before anything is fitted: exposure, noise, outline, light, what to change."""
