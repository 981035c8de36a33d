"""Handey Studio: locate parts in a pile, choose grasps, plan and place, and understand every decision."""
